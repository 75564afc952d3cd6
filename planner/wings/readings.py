"""Readings at the cell: a head of indicators that is centred on balls, and a bar or wire that is read at each pose."""

from planner.common.advice import Occasion, register_advice
from planner.common.commands import register_command

PARTS = (
    "centring",
    "next_session/live_estimate.py",
    "next_session/live_advice.py",
    "cli/cell_commands.py",
)

register_advice(
    Occasion.READ_BY_HAND,
    "edbb measure PLAN -o run.csv asks for the reading at each pose (to try it: edbb simulate PLAN -o run.csv)",
)
register_advice(Occasion.CENTRED_SESSION, "edbb centre PLAN measures it")
register_advice(Occasion.CENTRED_COLUMNS, "; edbb centre writes all of it by itself")
register_advice(Occasion.NO_CENTRING_CALL, ", or let 'edbb centre' drive the robot")
register_advice(
    Occasion.CENTRED_BALL,
    "At each ball edbb centre drives the robot until all three indicators read as at the master ball. "
    "Without it, jog there by hand and note the joint angles.",
)
COMMANDS, GROUP = "planner.cli.cell_commands", "Measure"
register_command("centre", "Centre a head of indicators on the balls of a plan.", f"{COMMANDS}:centre_command", GROUP)
register_command("measure", "Read a bar or wire at each pose into a run.", f"{COMMANDS}:measure_command", GROUP)
