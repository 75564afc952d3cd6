"""What grows and drifts with temperature and with time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.catalogue.site import Site, entry, named
from planner.catalogue.types import Entry, Inner
from planner.effects.basis import Phi
from planner.effects.combined import Times
from planner.effects.heat import Elapsed, Warmth, WarmUp
from planner.model import Move, Parameter
from planner.model.parameters import reading, transform

GROWTH, LARGEST_GROWTH = 1.2e-5, 1e-4  # [1/K] steel; several times as much where the air is not as warm as the arm
TURN, LARGEST_TURN = 2e-4, 5e-3  # [rad] over a run
SHIFT, LARGEST_SHIFT = 5e-5, 3e-3  # [m] over a run
STEPS = 12  # time constants that are scanned
HEINE = "Heisel, Richter & Wurst 1997, CIRP Annals 46(1): thermal behaviour of industrial robots, 0.1 to 0.5 mm"
STEEL = "thermal expansion of steel and aluminium, 11 to 24e-6 1/K"


@dataclass(frozen=True)
class Cause:
    """Heat or time as φ, its unit, and its largest size in the run; ``word`` names the kind."""

    word: str
    phi: Phi
    per: str
    size: float
    how: str


def link_growth(site: Site) -> Iterator[Entry]:
    """All links grow alike."""
    if not site.varies("temperature"):
        return
    warmth = Warmth(site.warmth)
    parameter = Parameter("link_growth", "1/K", GROWTH, "thermal growth of all links", _lengths(site, warmth))
    sentence = "the arm's links grow with temperature, by {size}"
    yield entry("link growth", "arm", [parameter], sentence, LARGEST_GROWTH, STEEL, False)


def drift(site: Site) -> Iterator[Entry]:
    """Joints, base and gauge that move with temperature, or steadily in time."""
    for cause in _causes(site):
        for i in range(site.n_joints):
            moved = transform(site.theta(i), cause.phi)
            name = f"{cause.word.replace(' ', '_')}{i + 1}"
            size = TURN / cause.size
            what = f"{cause.word} of joint {i + 1}"
            parameter = Parameter(name, f"rad/{cause.per}", size, what, moved)
            sentence = f"joint {i + 1}: its zero drifts {cause.how}, {{size}}"
            yield _steady(cause.word, f"joint {i + 1}", [parameter], sentence, LARGEST_TURN / cause.size)
        yield from _drift_of_frames(site, cause)


def warm_up(site: Site) -> Iterator[Entry]:
    """Joints, links and base that warm up to a new balance, with a time constant that nobody knows."""
    if not site.timed:
        return
    inner = Inner("time constant", "s", np.geomspace(site.duration / 50, site.duration * 2, STEPS), True)
    for i in range(site.n_joints):
        sentence = f"joint {i + 1}: warms up over {{inner}} and moves by {{size}}"
        make = partial(_warm_joint, site, i)
        yield Entry("warm-up", f"joint {i + 1}", make, sentence, LARGEST_TURN, HEINE, inner, False)
    sentence = "the arm's links warm up over {inner} and grow by {size}"
    yield Entry("warm-up", "arm", partial(_warm_links, site), sentence, 1e-3, HEINE, inner, False)
    sentence = "the base warms up over {inner} and moves by {size}"
    yield Entry("warm-up", "base", partial(_warm_base, site), sentence, LARGEST_SHIFT, HEINE, inner, False)


def _causes(site: Site) -> Iterator[Cause]:
    if site.varies("temperature"):
        warmth = Warmth(site.warmth)
        yield Cause("thermal drift", warmth, "K", site.largest(warmth), "with temperature")
    if site.timed:
        yield Cause("drift", Elapsed(site.start), "s", site.duration, "steadily")


def _drift_of_frames(site: Site, cause: Cause) -> Iterator[Entry]:
    label, unit = cause.word.replace(" ", "_"), f"m/{cause.per}"
    prior, largest = SHIFT / cause.size, LARGEST_SHIFT / cause.size
    shifts = [
        Parameter(f"{label}_base_{a}", unit, prior, f"{cause.word} of the base along {a}", transform(k, cause.phi))
        for k, a in enumerate("xyz")
    ]
    sentence = f"base and gauge drift apart {cause.how}, {{size}}"
    yield _steady(cause.word, "base", shifts, sentence, largest)
    turns = [
        Parameter(
            f"{label}_base_r{a}", f"rad/{cause.per}", TURN / cause.size, f"{cause.word} of the base about {a}",
            transform(3 + k, cause.phi),
        )
        for k, a in enumerate("xyz")
    ]  # fmt: skip
    sentence = f"the base tilts {cause.how}, {{size}}"
    largest_turn = LARGEST_TURN / cause.size
    yield _steady(cause.word, "base tilt", turns, sentence, largest_turn)
    if site.rig.kind == "length":
        zero = Parameter(f"{label}_zero", unit, prior, f"{cause.word} of the gauge's zero", reading(cause.phi))
        sentence = f"the gauge's zero drifts {cause.how}, {{size}}"
        yield _steady(cause.word, "gauge", [zero], sentence, largest)


def _steady(kind: str, on: str, parameters: Sequence[Parameter], sentence: str, largest: float) -> Entry:
    return entry(kind, on, parameters, sentence, largest, HEINE, False)


def _lengths(site: Site, phi: Phi) -> tuple[Move, ...]:
    return tuple(Move("transform", k, Times(phi, value)) for k, value in site.lengths)


def _warm(site: Site, constant: float | None) -> WarmUp:
    assert constant is not None
    return WarmUp(site.start, constant)


def _warm_joint(site: Site, joint: int, constant: float | None) -> tuple[Parameter, ...]:
    moves = transform(site.theta(joint), _warm(site, constant))
    what = f"warm-up of joint {joint + 1}"
    return named("warm-up", f"joint {joint + 1}", Parameter(f"warm_up{joint + 1}", "rad", TURN, what, moves))


def _warm_links(site: Site, constant: float | None) -> tuple[Parameter, ...]:
    moves = _lengths(site, _warm(site, constant))
    return named("warm-up", "arm", Parameter("warm_up_links", "1", 1e-4, "growth of all links by warming up", moves))


def _warm_base(site: Site, constant: float | None) -> tuple[Parameter, ...]:
    phi = _warm(site, constant)
    shifts = (
        Parameter(f"warm_up_base_{a}", "m", SHIFT, f"warm-up of the base along {a}", transform(k, phi))
        for k, a in enumerate("xyz")
    )
    return named("warm-up", "base", *shifts)
