"""What changes at an unknown sample of a run: something that stood elsewhere before, or a row that is wrong.

Whatever is fitted may step: a fixture that was knocked, a wire clamped anew, a tool that slipped, a joint's zero. A
step counts from the samples before it, so that the rest of the model is how things stand at the end of the run.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array
from planner.effects.basis import ONE, BasisFunction, EffectVariable, Times
from planner.effects.catalogue import Excitation, register
from planner.effects.compliance import weight_turns
from planner.effects.context import Context
from planner.effects.effect import (
    BASE_SHIFTS,
    BASE_TURNS,
    Effect,
    Parameter,
    ParameterMove,
    Place,
    Role,
    joint_place,
    reading_move,
    transform_move,
)
from planner.effects.set_up_errors import set_up_parts
from planner.effects.sizes import ESTIMATED, SUDDEN_CHANGE, WRONG_ROW

STEP, SLIP = "step", "wrong row"


class BeforeSample(BasisFunction, key="before:INDEX:PHI", static=False, gauge=True):
    """φ = −PHI in the samples before this one, from 0, and 0 from it on; a run without numbers came later."""

    sample: int
    phi: BasisFunction = ONE

    def __call__(self, c: Context) -> Array:
        """Return the function before the step."""
        number = c.samples.number
        return np.zeros(1) if number is None else np.where(number < self.sample, -c.value(self.phi), 0.0)

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw against the sample."""
        return _against_sample(c)


class AtSample(BasisFunction, key="row:INDEX", static=False, gauge=True):
    """φ = 1 in one sample, from 0, else 0."""

    sample: int

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        number = c.samples.number
        return np.zeros(1) if number is None else np.asarray(number == self.sample, dtype=float)

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw against the sample."""
        return _against_sample(c)


def _against_sample(c: Context) -> EffectVariable | None:
    return (
        None if c.samples.number is None else EffectVariable("sample of the run", c.samples.number.astype(float) + 1.0)
    )


@register(STEP, SLIP, needs="nothing that can be planned: nobody knows when something moves")
def no_steps_beforehand(run: Excitation) -> Iterator[Effect]:
    """Yield nothing: the search itself finds the sample of a step."""
    yield from ()


@dataclass(frozen=True)
class Steppable:
    """Something that may step: its parameters as they would act all along, and a sentence with ``{size}``."""

    place: Place
    sentence: str
    parameters: tuple[Parameter, ...]

    def step(self, sample: int, scanned: int) -> Effect:
        """Return the step before sample ``sample``, from 0; ``scanned``: how many samples and things were tried."""
        parameters = tuple(
            replace(
                p,
                name=f"step{sample}_{p.name}",
                prior=SUDDEN_CHANGE.usual,
                what=f"step after sample {sample}: {p.what}",
                moves=tuple(replace(m, phi=BeforeSample(sample, m.phi)) for m in p.moves),
            )
            for p in self.parameters
        )
        sentence = f"after sample {sample} {self.sentence}"
        return Effect(
            STEP, self.place, parameters, sentence, SUDDEN_CHANGE.largest, ESTIMATED, role=Role.CHANGE,
            scanned=scanned,
        )  # fmt: skip


def extend_over_run(p: Parameter) -> Parameter:
    """Return the parameter of a step as it would act in every sample."""
    moves = (replace(m, phi=m.phi.phi) if isinstance(m.phi, BeforeSample) else m for m in p.moves)
    return replace(p, moves=tuple(moves))


def wrong_row(width: int, sample: int, scanned: int) -> Effect:
    """Return the effect of a wrong reading at ``sample``: each of its ``width`` numbers is off by its own error."""
    parameters = tuple(
        Parameter(
            f"row{sample + 1}_{k + 1}", "m" if k < 3 else "rad", WRONG_ROW.usual,
            f"error of the reading in row {sample + 1}", reading_move(AtSample(sample), k),
        )
        for k in range(width)
    )  # fmt: skip
    sentence = f"row {sample + 1} is off by {{size}}"
    place = Place(f"row {sample + 1}")
    return Effect(SLIP, place, parameters, sentence, WRONG_ROW.largest, ESTIMATED, role=Role.CHANGE, scanned=scanned)


def steppables(run: Excitation) -> Iterator[Steppable]:
    """Yield everything in a set-up that may step: what places the gauge, base, payload, and each joint's zero."""
    setup, several = run.setup, len(run.setup.place_names) > 1
    groups = set_up_parts(setup)
    if several:
        groups["base"] = [
            Parameter(f"base_{m.name}", "m", 1.0, f"base {m.words}", m.times(ONE)) for m in (*BASE_SHIFTS, *BASE_TURNS)
        ]
    for label, group in groups.items():
        part, sentence = _words(label, several)
        yield Steppable(Place(part), sentence, tuple(_as_shift(run, p) for p in group))
    for i in run.joints:
        name, unit = setup.robot.zero_names[i], "m" if setup.robot.slides[i] else "rad"
        zero = Parameter(name, unit, 1.0, f"zero of joint {i + 1}", transform_move(run.rotation(i)))
        yield Steppable(joint_place(i), f"the zero of joint {i + 1} stood {{size}} elsewhere", (zero,))
    yield from _payload(run)


def _words(label: str, several: bool) -> tuple[str, str]:
    """Return place and sentence of a group of the gauge's parameters."""
    thing, _, name = label.partition("_")
    if thing == "fixture":
        which, article = (f"fixture {name}", "") if name else ("fixture", "the ")
        return which, f"{article}{which}{'' if several else ' (or the base)'} stood {{size}} elsewhere"
    if thing == "zero":
        which = f"{name} gauge".strip()
        return which, f"the {which} read {{size}} {{more}}"
    if thing == "map":
        which, article = (f"tool point {name}", "") if name else ("tool point", "the ")
        return which, f"{article}{which} sat {{size}} elsewhere on the flange"
    if thing == "probe":
        return "probe", "the probe was turned otherwise on the flange, by {size}"
    if name or not several:
        which = f"gauge at {name}" if name else "gauge's frame"
        return which, f"the {which}{'' if name else ' (or the base)'} stood {{size}} elsewhere"
    return "base", "the base stood {size} elsewhere"


def _as_shift(run: Excitation, p: Parameter) -> Parameter:
    """Return a turn of the base as the shift [m] that it gives the measured points, about the middle of them."""
    move = p.main_move
    if move.on != "transform" or not 3 <= move.index < 6:
        return p
    x = run.context.motion.x
    centre = x.mean(axis=1)
    lever = max(float(np.sqrt(((x - centre[:, None]) ** 2).sum(axis=0).mean() * 2 / 3)), 1e-3)
    back = -np.cross(np.eye(3)[move.index - 3], centre) / lever
    moves = [replace(move, phi=Times(1 / lever, move.phi))]
    moves += [ParameterMove("transform", k, Times(float(b), move.phi)) for k, b in enumerate(back) if b]
    return replace(p, unit="m", moves=tuple(moves))


def _payload(run: Excitation) -> Iterator[Steppable]:
    """Yield a step of the payload: it turns every compliant joint by its torque, the two most loaded ones the most."""
    parameters = tuple(
        Parameter(f"payload_at{i + 1}", "rad", 1.0, f"turn of joint {i + 1} under another payload", moves)
        for i, moves in weight_turns(run, run.setup.robot.n_joints, 0.0)
    )
    if parameters:
        yield Steppable(Place("payload"), "the payload was another one, its joints turn {size} under it", parameters)
