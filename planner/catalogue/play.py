"""Play of gears, and angles that were read while the arm still moved."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.catalogue.site import Site, entry, named
from planner.catalogue.types import Entry, Inner
from planner.effects.basis import Phi
from planner.effects.loads import TorqueSign
from planner.effects.motion import Approach, Behind, Hysteresis, SpeedSign, Unsettled
from planner.model import Move, Parameter
from planner.model.parameters import transform


@dataclass(frozen=True)
class Sizes:
    """Unit of an effect's size, its usual (one sigma) and largest plausible value, and where they come from."""

    unit: str
    usual: float
    largest: float
    source: str


PLAY = Sizes(
    "rad", 1e-4, 1e-2, "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(5): backlash of a serial robot, 0.01-0.1 mm"
)
LAG = Sizes("s", 2e-3, 0.1, "estimated")
PART = Sizes("1", 0.5, 2.0, "estimated")
WIDTHS = np.geomspace(5e-3, 1.0, 16)  # [rad] of travel after a reversal


def backlash(site: Site) -> Iterator[Entry]:
    """Play that shows by the side from which a joint comes: its speed's sign, or its last approach."""
    s = site.samples
    for i in site.moving:
        if s.speed is not None:
            phi: Phi = SpeedSign(i)
            both = np.ptp(np.sign(s.speed[:, i])) > 1
        elif s.direction is not None:
            phi, both = Approach(i), np.ptp(s.direction[:, i]) > 1
        else:
            return
        if both:
            sentence = f"joint {i + 1}: play of {{size}} between the two directions"
            yield _on_joint(site, "backlash", i, phi, PLAY, sentence)


def backlash_by_load(site: Site) -> Iterator[Entry]:
    """Play that shows by the side on which the load lies."""
    for i in range(site.n_joints):
        sign = np.sign(site.context.load_torque[:, i])
        if np.minimum((sign > 0).mean(), (sign < 0).mean()) > 0.005:
            sentence = f"joint {i + 1}: play of {{size}}, on the side on which the load lies"
            yield _on_joint(site, "backlash by load", i, TorqueSign(i), PLAY, sentence, True)


def hysteresis(site: Site) -> Iterator[Entry]:
    """Friction on a spring: the joint turns gradually from one side of its play to the other."""
    if getattr(site.samples, "reversals", None) is None:
        return
    inner = Inner("width", "rad", WIDTHS, True)
    for i in site.moving:
        sentence = f"joint {i + 1}: friction holds it back by {{size}}, and lets go over {{inner}} of travel"
        make = partial(_sprung, site, i)
        yield Entry("hysteresis", f"joint {i + 1}", make, sentence, PLAY.largest, PLAY.source, inner, False)


def _sprung(site: Site, i: int, width: float | None) -> tuple[Parameter, ...]:
    assert width is not None
    moves = transform(site.theta(i), Hysteresis(i, width))
    what = f"hysteresis of joint {i + 1}"
    return named("hysteresis", f"joint {i + 1}", Parameter(f"hysteresis{i + 1}", PLAY.unit, PLAY.usual, what, moves))


def unsettled(site: Site) -> Iterator[Entry]:
    """The arm stood between the commanded and the read angle."""
    s = site.samples
    if s.q_cmd is None or s.q_read is None:
        return
    gap = np.abs(s.q_cmd - s.q_read).max(axis=0)
    if not np.any(gap > 0):
        return
    sentence = "angles were read before the arm had settled: it stood {size} of the way on to the commanded ones"
    yield _all_joints(site, "unsettled angle", Unsettled(0), PART, sentence)
    for i in np.flatnonzero(gap > 0):
        sentence = f"joint {i + 1}: was read before it had settled, {{size}} of the way to the commanded angle missing"
        yield _on_joint(site, "unsettled angle", int(i), Unsettled(int(i)), PART, sentence)


def servo_lag(site: Site) -> Iterator[Entry]:
    """Joints that stand where they were read a moment ago."""
    if not site.varies("speed"):
        return
    sentence = "all joints: the arm runs {size} behind the angles as logged"
    yield _all_joints(site, "servo lag", Behind(0), LAG, sentence)
    for i in site.moving:
        sentence = f"joint {i + 1}: runs {{size}} behind its logged angle"
        yield _on_joint(site, "servo lag", i, Behind(i), LAG, sentence)


def _on_joint(site: Site, kind: str, i: int, phi: Phi, sizes: Sizes, sentence: str, static: bool = False) -> Entry:
    on, label = f"joint {i + 1}", f"{kind.replace(' ', '_')}{i + 1}"
    moves = transform(site.theta(i), phi)
    parameter = Parameter(label, sizes.unit, sizes.usual, f"{kind} of {on}", moves)
    return entry(kind, on, [parameter], sentence, sizes.largest, sizes.source, static)


def _all_joints(site: Site, kind: str, phi: Unsettled | Behind, sizes: Sizes, sentence: str) -> Entry:
    moves = tuple(Move("transform", site.theta(i), replace(phi, joint=i)) for i in range(site.n_joints))
    parameter = Parameter(f"{kind.replace(' ', '_')}_all", sizes.unit, sizes.usual, f"{kind} of all joints", moves)
    return entry(kind, "all joints", [parameter], sentence, sizes.largest, sizes.source, False)
