"""The verbs of the command; only the one that is called is loaded, since some need libraries that take seconds."""

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

VERBS = {  # name: (module, function, line in the list of commands)
    "plan": ("planning", "plan_command", "Plan a measuring session: poses, path, robot program, report."),
    "study": ("planning", "study_command", "Observability offline: what can be seen, and from where."),
    "export": ("planning", "export_command", "Write the robot program of a plan in any dialect."),
    "simulate": ("calibrating", "simulate_command", "Simulate the measured run of a plan."),
    "identify": ("calibrating", "identify_command", "Identify the robot from measured runs."),
    "import": ("calibrating", "import_command", "Bring controller and gauge traces into the run format."),
    "compensate": ("calibrating", "compensate_command", "Correct a program for the calibrated robot."),
    "accuracy": ("accuracy", "accuracy_command", "Judge a robot by a tracker's run, or repeated centrings."),
    "circular": ("circular", "circular_command", "Evaluate a circular test in the manner of ISO 230-4."),
    "loaded": ("loaded", "loaded_command", "Evaluate circles driven under load: joint compliances."),
    "loaded-places": ("loaded", "places_command", "Find where loaded circles tell the compliances apart."),
    "plan-both": ("loaded_both", "both_command", "Plan a session with an unloaded and a loaded bar."),
    "centre": ("centring", "centre_command", "Centre a head of indicators on the balls of a plan."),
    "robots": ("shipped", "robots_command", "List the robots and cells that come with the planner."),
    "dialects": ("shipped", "dialects_command", "List the robot languages that programs can be written in."),
}


class Verb(TyperCommand):
    """A command whose help shows no type behind its switches: they take no value."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, switches without a type."""
        return switches_alone(super().get_params(ctx))


class Verbs(TyperGroup):
    """The list of all verbs, and the one that is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for name, (_, _, line) in VERBS.items():
            self.add_command(TyperCommand(name, help=line))

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, switches without a type."""
        return switches_alone(super().get_params(ctx))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and other words of what is called."""
        name, command, words = super().resolve_command(ctx, args)
        return name, None if name is None or command is None else load(name), words


def switches_alone(parameters: list[Any]) -> list[Any]:
    """Take the type off every option that has no value."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


def load(name: str) -> Any:
    """Return the command ``name``, with the libraries that it needs."""
    module, function, _ = VERBS[name]
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(name, cls=Verb)(getattr(import_module(f"planner.cli.{module}"), function))
    return typer.main.get_command(alone)
