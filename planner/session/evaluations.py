"""Which command evaluates the run of a plan, and what is said of plans for other purposes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.common.console import as_word
from planner.common.extensions import load_extensions


@dataclass(frozen=True)
class Evaluation:
    """A command that evaluates the runs of some plans.

    Attributes:
        command: what is typed, with ``{run}``, ``{plan}``, ``{cell}`` and ``{model}`` to fill in.
        kind: of the plan; nothing for poses.
        beside: the plans that it is for have this file beside them; empty for any.
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
    run: Path | str, plan: Path, kind: str | None, calibrates: bool, model: Path | str = "CALIBRATED"
) -> str:
    """Return the command that evaluates the run of a plan, empty where none here does.

    Identification does those of poses for which no extension knows better. ``model``: the calibration that a run is
    judged by, where one is.
    """
    load_extensions()
    fitting = (e.command for e in _EVALUATIONS if e.fits(plan, kind, calibrates))
    known = "edbb identify {run} --cell {cell} --plan {plan} -o calibrated" if kind is None else ""
    words = {"run": run, "plan": plan, "cell": plan.parent / "cell.toml", "model": model}
    return next(fitting, known).format(**{key: as_word(word) for key, word in words.items()})
