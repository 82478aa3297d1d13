"""The command line `hm2`: one file per group of commands, listed in `main.COMMANDS`."""

from hostmot2.cli.main import main

__all__ = ["main"]
