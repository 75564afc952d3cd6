"""What moves slowly in the time of a run and has no name: parts of an arm, its lengths, the base and the gauge.

Arms that warm up move so, for causes that nobody logged. All of it is nought on average over the run, so that the robot
beside it is the arm as it was on average.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from planner.cell.placement import N_BASE_TRANSFORMS
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.catalogue import Excitation
from planner.effects.compliance import twist_moves
from planner.effects.context import Context
from planner.effects.effect import (
    BASE_SHIFTS,
    BASE_TURNS,
    Parameter,
    ParameterMove,
    reading_move,
    transform_move,
)

Mover = Callable[[BasisFunction], tuple[ParameterMove, ...]]
IN_TIME = "by time"  # last words of the families


class TimeWave(BasisFunction, key="time-wave:NUMBER:NUMBER:INDEX", static=False, run=True, column="t"):
    """φ = √2 cos(π k (t − start)/duration): of mean 0 and mean square 1 over the run."""

    start: float
    duration: float
    wave: int
    uncorrected = "drift with time"

    def __call__(self, c: Context) -> Array:
        """Return the wave."""
        return np.asarray(np.sqrt(2) * np.cos(np.pi * self.wave * (c.column("t") - self.start) / self.duration))


def drift_shapes(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield families of parameters by name: parts turn about all axes; lengths, base, gauge shift."""
    if run.duration < 600.0:  # [s] in which no arm drifts: castings take more than ten minutes to warm up
        return
    for joint in run.joints:
        turns = [(f"{joint + 1}_{'xyz'[axis]}", "rad", partial(twist_moves, joint + 1, axis)) for axis in range(3)]
        yield f"part {joint + 1} {IN_TIME}", tuple(_slow_waves(run, turns))
    own = enumerate(run.setup.robot.transforms, N_BASE_TRANSFORMS)
    lengths = [(f"_{t.name}", "m", partial(transform_move, k)) for k, t in own if t.kind == "translation"]
    yield f"lengths {IN_TIME}", tuple(_slow_waves(run, lengths))
    base = [(f"_base_{m.name}", "m", m.times) for m in BASE_SHIFTS]
    yield (
        f"base {IN_TIME}",
        tuple(_slow_waves(run, [*base, *((f"_base_{m.name}", "rad", m.times) for m in BASE_TURNS)])),
    )
    if run.setup.gauge.has_zero:
        yield f"gauge {IN_TIME}", tuple(_slow_waves(run, [("_zero", "m", reading_move)]))


def _slow_waves(run: Excitation, moves: Sequence[tuple[str, str, Mover]]) -> Iterator[Parameter]:
    """Yield waves of time, the k-th by k² smaller, of each motion: end of its name, unit, and what moves by φ."""
    waves = np.arange(1, 3 + 1)  # of half a period over the run, and so on: from a drift to a quick warm-up and back
    share = waves**-2.0 / np.sqrt((waves**-4.0).sum())
    for label, unit, mover in moves:
        # one sigma of all waves: a part turns as much as of any cause, arms of some metres grow by 0.1 mm
        usual = 1e-4 if unit == "rad" else 5e-5  # [rad], [m]
        for k, part in zip(waves.tolist(), share.tolist(), strict=True):
            phi = TimeWave(run.start, run.duration, k)
            yield Parameter(f"misfit{label}_time{k}", unit, usual * part, "slow motion in time", mover(phi))
