"""The command line."""

from thermid.cli.app import main

__all__ = ["main"]
