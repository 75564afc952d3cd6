"""Which command evaluates the run of a plan, and what is said of plans for other purposes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.common.console import as_word
from planner.common.errors import InputError
from planner.common.extensions import load_extensions


@dataclass(frozen=True)
class Evaluation:
    """A command that evaluates the runs of some plans.

    Attributes:
        command: what is typed, with ``{run}``, ``{plan}``, ``{cell}`` and ``{model}`` to fill in.
        kind: of the plan; nothing for poses.
        beside: the plans that it is for have this file (JSON) beside them; empty for any. Its key ``model`` names the
            calibration that the run is judged by, as it was typed where the plan was made.
        calibrates: whether poses of the plan calibrate; nothing for both.
    """

    command: str
    kind: str | None = None
    beside: str = ""
    calibrates: bool | None = None

    def fits(self, plan: Path, kind: str | None, calibrates: bool) -> bool:
        """Tell whether it is for a plan at a path."""
        there = not self.beside or (plan.parent / self.beside).is_file()
        return self.kind == kind and there and self.calibrates in (None, calibrates)

    def model(self, plan: Path) -> str:
        """Return the calibration that the runs of a plan are judged by; where it is not found here, the word for it."""
        from planner.common.schema import read_json  # with pydantic, which the help of a command need not load

        try:
            content = read_json(plan.parent / self.beside) if self.beside else None
        except InputError:  # a plan is made use of without what is beside it
            content = None
        named = content.get("model") if isinstance(content, dict) else None
        return named if isinstance(named, str) and Path(named).exists() else "CALIBRATED"


_EVALUATIONS: list[Evaluation] = []
_DRAWN: dict[str, str] = {}


def register_evaluation(evaluation: Evaluation) -> None:
    """Make known what evaluates the runs of some plans; what a file beside the plan asks for comes first."""
    _EVALUATIONS.append(evaluation)
    _EVALUATIONS.sort(key=lambda e: not e.beside)


def register_drawn_warning(note: str, warning: str) -> None:
    """Let a simulation warn where a robot is drawn anew for a plan that has ``note`` among its notes."""
    _DRAWN[note] = warning


def simulated_run_warnings(notes: Sequence[str]) -> tuple[str, ...]:
    """Return the warnings for a simulated run of a plan with these notes: its robot is drawn at random."""
    load_extensions()
    return tuple(warning for note, warning in _DRAWN.items() if note in notes)


def evaluation_of(
    run: Path | str, plan: Path, kind: str | None, calibrates: bool, model: Path | str | None = None
) -> str:
    """Return the command that evaluates the run of a plan, empty where none here does.

    Identification does those of poses for which no extension knows better. ``model``: the calibration that a run is
    judged by, where one is; by default the one that is named beside the plan.
    """
    load_extensions()
    own = next((e for e in _EVALUATIONS if e.fits(plan, kind, calibrates)), None)
    if own is None and kind is not None:
        return ""
    command = "edbb identify {run} --cell {cell} --plan {plan} -o calibrated" if own is None else own.command
    words = {"run": run, "plan": plan, "cell": plan.parent / "cell.toml"}
    if "{model}" in command:
        words["model"] = model or (own.model(plan) if own else "")
    return command.format(**{key: as_word(word) for key, word in words.items()})
