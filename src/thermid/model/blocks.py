"""Blocks of a regular grid of cells."""

from thermid.model._blocks.block import FACES as FACES, Block as Block, Exchange as Exchange
