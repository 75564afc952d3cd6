"""Readings at the cell: a head of indicators that is centred on balls, and a bar or wire that is read at each pose."""

from planner.common.commands import register_command

PARTS = (
    "instruments/centring",
    "instruments/live_gauge.py",
    "instruments/live_estimate.py",
    "instruments/live_advice.py",
    "cli/cell_commands.py",
)

COMMANDS, GROUP = "planner.cli.cell_commands", "Measure"
register_command("centre", "Centre a head of indicators on the balls of a plan.", f"{COMMANDS}:centre_command", GROUP)
register_command("measure", "Read a bar or wire at each pose into a run.", f"{COMMANDS}:measure_command", GROUP)
