"""The command ``edbb``: every verb of the planner for the person at the cell."""

from planner.cli.app import main

__all__ = ["main"]
