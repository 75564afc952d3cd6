"""What may change on a robot after its calibration, how each shows in the readings, and what a person does about it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup
from planner.common.units import Array
from planner.effects.backlash import ApproachDirection
from planner.effects.basis import ONE, BasisFunction
from planner.effects.gears import WAVES, JointWave
from planner.effects.parameters import Parameter, transform_move
from planner.identification.baseline import Baseline
from planner.model.model import Model
from planner.model.tool_error import tool_rows, uniform_states
from planner.runs.run import Samples

ChangeKind = Literal["zero", "gear", "fixture", "tool", "collision"]
STATES = 400  # of the workspace, over which the motion of the tool is taken


@dataclass(frozen=True)
class Change:
    """One thing that may have changed.

    Attributes:
        kind, name: what, in words.
        parameters: by which it changes readings, d of them.
        square: mean square motion of the tool over the workspace per squared parameters, (d, d) [m² per unit²]; of a
            fixture its own.
        advice: what a person does about it.
    """

    kind: ChangeKind
    name: str
    parameters: tuple[Parameter, ...]
    square: Array
    advice: str


def possible_changes(cell: Cell, setup: MeasurementSetup, with_play: bool) -> tuple[Change, ...]:
    """Return all that a check looks for.

    Args:
        cell, setup: that are checked.
        with_play: whether the directions are known from which the joints came to the poses.
    """
    bare = list(_bare_changes(setup, with_play))
    q = uniform_states(cell, STATES, 0)
    sides = np.random.default_rng(1).choice([-1.0, 1.0], size=q.shape)
    samples = Samples(q, np.zeros(len(q), dtype=int), direction=sides)
    own = _by_change(tool_rows(samples, setup, _numbered_parameters(bare))[2], bare)
    moved = zip(bare, own, strict=True)
    return tuple(c if c.kind == "fixture" else replace(c, square=m.T @ m / len(q)) for c, m in moved)


def change_columns(baseline: Baseline, samples: Samples, changes: Sequence[Change]) -> tuple[Array, ...]:
    """Return what every change does to readings, (n, d) [m per unit] each."""
    return _by_change(baseline.rows(samples, _numbered_parameters(changes)), changes)


def _numbered_parameters(changes: Sequence[Change]) -> list[Parameter]:
    """Parameters of all changes, each with a name of its own."""
    return [replace(p, name=f"{k}, {p.name}") for k, c in enumerate(changes) for p in c.parameters]


def _by_change(rows: Array, changes: Sequence[Change]) -> tuple[Array, ...]:
    """Split the last columns of rows (n, P), those of the changes, into one block a change."""
    ends = np.cumsum([len(c.parameters) for c in changes])
    return tuple(np.split(rows[:, -ends[-1] :], ends[:-1], axis=1))


def _bare_changes(setup: MeasurementSetup, with_play: bool) -> Iterator[Change]:
    """Yield them with squares of ones, as is right for fixtures."""
    rotation = {t.joint: k for k, t in enumerate(setup.chain.transforms) if t.joint is not None}
    zeros = tuple(_parameter(rotation[j], f"zero{j + 1}") for j in sorted(rotation))
    for j, p in enumerate(zeros, 1):
        yield _change("zero", f"zero of joint {j}", (p,), f"master axis {j} and check again")
    for j in sorted(rotation):
        phis: list[BasisFunction] = [JointWave(w, j, 1.0) for w in WAVES]
        phis += [ApproachDirection(j)] if with_play else []
        parameters = tuple(_parameter(rotation[j], f"gear{j + 1}_{k}", phi) for k, phi in enumerate(phis))
        advice = f"call service: gear or bearing of axis {j + 1}"
        yield _change("gear", f"gear of joint {j + 1}", parameters, advice)
    tool = tuple(_parameter(setup.chain.index(f"map_{a}"), f"tool_{a}", unit="m") for a in "xyz")
    yield _change("tool", "tool", tool, "check the tool flange and the seat of the ball on the tool, then check again")
    fixtures = Model.of(setup, frozenset({"fixture"})).parameters
    for name in setup.place_names:
        label = f"fixture {name}".rstrip()
        names = {f"{label.replace(' ', '_')}_{a}" for a in "xyz"}
        if own := tuple(p for p in fixtures if p.name in names):
            advice = f"check that {label} stands fast and its cup is clean, then check again"
            yield _change("fixture", label, own, advice)
    hit = (*zeros, *tool)
    yield _change("collision", "several axes and the tool", hit, "something was hit or moved: calibrate again")


def _change(kind: ChangeKind, name: str, parameters: tuple[Parameter, ...], advice: str) -> Change:
    return Change(kind, name, parameters, np.eye(len(parameters)), advice)


def _parameter(transform: int, name: str, phi: BasisFunction = ONE, unit: str = "rad") -> Parameter:
    return Parameter(name, unit, 1.0, name, transform_move(transform, phi), "change")
