"""The command line."""

from thermid.cli.app import main as main
