"""Fleets: how large errors of a kind of robot are, learnt from several of them."""

from planner.common.commands import register_command, register_names

PARTS = ("workflow/fleet.py", "cli/fleet_commands.py")

register_command("fleet", "Learn from several robots how large errors are.", "planner.cli.fleet_commands:fleet_command",
                 "Keep", needs=("checks",))  # fmt: skip
register_names("planner.workflow.fleet", "FleetResult", "fleet")
