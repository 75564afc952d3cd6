"""What encoders, gears and couplings do to the angle of a joint."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from planner.catalogue.site import Site, entry, named, spread, twisting
from planner.catalogue.types import Entry, Inner
from planner.effects.waves import Angle, Cosine, Sine
from planner.model import Parameter
from planner.model.parameters import transform

SIZE = 1e-4  # [rad], one sigma of a wave: 20 arc seconds
LARGEST = 5e-3  # [rad]
LOWEST, HIGHEST = 2.5, 400.0  # waves in a turn of the joint that are scanned
PHASE = 0.25  # of a wave over the range of the joint between neighbours of the scan
TURN = 2 * np.pi
SLAMANI = "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(1): positioning errors of a serial robot, 0.1 mm waves"
STRAIN = "Ghorbel, Gandhi & Alpeter 2001, J. Mech. Design 123(1): strain-wave gears err twice a turn of the motor"


def encoder(site: Site) -> Iterator[Entry]:
    """Encoder out of centre (once a turn) or out of round (twice a turn)."""
    for i in site.moving:
        for often, word, why in ((1.0, "once", "out of centre"), (2.0, "twice", "out of round or tilted")):
            kind = f"encoder {word} a turn"
            sentence = f"joint {i + 1}: encoder or gear {why}, an error {word} a turn, {{size}}"
            make = partial(_waves, site, kind, i, often)
            yield Entry(kind, f"joint {i + 1}", make, sentence, LARGEST, SLAMANI)


def ripple(site: Site) -> Iterator[Entry]:
    """Gear error at any number of waves a turn."""
    for i in site.moving:
        grid = np.arange(LOWEST, _top(site, i), PHASE * TURN / spread(site.samples.q[:, i]))
        sentence = f"joint {i + 1}: gear runs out {{inner}} times a turn, {{size}}"
        inner = Inner("frequency", "1/turn", grid)
        make = partial(_any_waves, site, "gear ripple", i)
        yield Entry("gear ripple", f"joint {i + 1}", make, sentence, LARGEST, SLAMANI, inner)


def named_ripple(site: Site) -> Iterator[Entry]:
    """Gear errors whose number a turn follows from the gear ratio that the robot's file states."""
    for i in site.moving:
        ratio = site.rig.robot.gear_ratio[i]
        if ratio is None:
            continue
        for often, kind, why in (
            (2.0 * ratio, "strain-wave error", "strain-wave gear errs twice a turn of its wave generator"),
            (1.0 * ratio, "motor-side error", "motor, its encoder or the gear's input runs out once a turn"),
        ):
            sentence = f"joint {i + 1}: {why} ({often:g} times a turn of the joint), {{size}}"
            make = partial(_waves, site, kind, i, often)
            yield Entry(kind, f"joint {i + 1}", make, sentence, LARGEST, STRAIN)


def ratio(site: Site) -> Iterator[Entry]:
    """A reduction ratio that is not what the controller thinks."""
    for i in site.moving:
        sentence = f"joint {i + 1}: reduction ratio is off, {{size}} of the joint's travel"
        make = partial(_driven, site, "reduction ratio", f"joint {i + 1}", i, i)
        yield Entry("reduction ratio", f"joint {i + 1}", make, sentence, 1e-2, "estimated")


def coupling(site: Site) -> Iterator[Entry]:
    """A joint that another one's drive moves along; neighbours first, as in wrists and behind parallelograms."""
    pairs = [(i, k) for i in range(site.n_joints) for k in site.moving if i != k]
    for i, k in sorted(pairs, key=lambda p: (abs(p[0] - p[1]), p)):
        on = f"joint {i + 1} by joint {k + 1}"
        sentence = f"joint {i + 1}: joint {k + 1} drives it along, {{size}} of that joint's travel"
        yield Entry(
            "coupling", on, partial(_driven, site, "coupling", on, i, k), sentence, 1e-2,
            "Nubiola & Bonev 2013, RCIM 29(1): coupling of wrist joints",
        )  # fmt: skip


def wobble(site: Site) -> Iterator[Entry]:
    """A joint's axis wobbles as it turns: its bearing runs out, or is squeezed out of round."""
    for i in site.moving:
        turn = site.rig.chain.transforms[site.theta(i)].axis
        for often, word in ((1.0, "once"), (2.0, "twice"), (3.0, "three times")):
            kind, on = f"axis wobble {word} a turn", f"joint {i + 1}"
            tilts = [
                Parameter(
                    f"wobble{i + 1}_{often:.0f}_{'xyz'[axis]}_{wave}", "rad", SIZE,
                    f"{kind} about {'xyz'[axis]}, {on}", twisting(i + 1, axis, phi),
                )
                for axis in range(3) if axis != turn
                for wave, phi in (("sin", Sine(i, often)), ("cos", Cosine(i, often)))
            ]  # fmt: skip
            sentence = f"{on}: bearing lets the axis wobble {word} a turn, {{size}}"
            yield entry(kind, on, tilts, sentence, LARGEST, "estimated")


def _top(site: Site, joint: int) -> float:
    ratio = site.rig.robot.gear_ratio[joint]
    return HIGHEST if ratio is None else max(HIGHEST, 2.2 * ratio)


def _any_waves(site: Site, kind: str, joint: int, inner: float | None) -> tuple[Parameter, ...]:
    assert inner is not None
    return _waves(site, kind, joint, inner, None)


def _waves(site: Site, kind: str, joint: int, frequency: float, _: float | None) -> tuple[Parameter, ...]:
    k = site.theta(joint)
    label = f"{kind.replace(' ', '_').replace('-', '_')}{joint + 1}_{frequency:.8g}"
    what = f"{kind} of joint {joint + 1}, {frequency:.8g} a turn"
    return named(
        kind,
        f"joint {joint + 1}",
        Parameter(f"{label}_sin", "rad", SIZE, f"{what}, sine", transform(k, Sine(joint, frequency))),
        Parameter(f"{label}_cos", "rad", SIZE, f"{what}, cosine", transform(k, Cosine(joint, frequency))),
    )


def _driven(site: Site, kind: str, on: str, joint: int, by: int, _: float | None) -> tuple[Parameter, ...]:
    mean = round(float(site.samples.q[:, by].mean()), 4)
    label = f"{kind.replace(' ', '_')}{joint + 1}" + (f"_by{by + 1}" if by != joint else "")
    moves = transform(site.theta(joint), Angle(by, mean))
    return named(kind, on, Parameter(label, "rad/rad", 5e-4, f"{kind} of {on}", moves))
