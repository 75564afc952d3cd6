"""What changes between sessions: the gauge's zero, the frame it stands in, a fixture that was mounted anew."""

from collections.abc import Iterator

import numpy as np

from planner.effects.effect import Effect, Excitation, effect_of
from planner.effects.parameters import Parameter, reading_move, transform_move
from planner.effects.thermal import InSession, MountedAnew

STEP, LARGEST_STEP = 5e-5, 5e-3  # [m]
STEP_TURN, LARGEST_STEP_TURN = 1e-4, 1e-2  # [rad]
ESTIMATED = "estimated"


def zero_step(site: Excitation) -> Iterator[Effect]:
    """The bar's zero is not the same in every session."""
    if not site.setup.gauge.has_zero or not site.sessions:
        return
    steps = [
        Parameter(f"zero_session{s}", "m", STEP, f"step of the zero in session {s}", reading_move(InSession(s)))
        for s in site.sessions
    ]
    sentence = "the gauge's zero steps from session to session, {size}"
    yield effect_of("session step", "gauge", steps, sentence, LARGEST_STEP, ESTIMATED, False)


def frame_step(site: Excitation) -> Iterator[Effect]:
    """Base and gauge stand otherwise to each other in every session."""
    if not site.sessions:
        return
    for kind_of, unit, size, largest, first, word in (
        ("base", "m", STEP, LARGEST_STEP, 0, "shifts"),
        ("base tilt", "rad", STEP_TURN, LARGEST_STEP_TURN, 3, "tilts"),
    ):
        steps = [
            Parameter(
                f"base_{'' if first == 0 else 'r'}{a}_session{s}", unit, size, f"{kind_of} along {a}, session {s}",
                transform_move(first + k, InSession(s)),
            )
            for s in site.sessions
            for k, a in enumerate("xyz")
        ]  # fmt: skip
        sentence = f"the base {word} against the gauge from session to session, {{size}}"
        yield effect_of("session step", kind_of, steps, sentence, largest, ESTIMATED, False)


def remounting(site: Excitation) -> Iterator[Effect]:
    """A fixture, plate or station that stands otherwise each time it was mounted, one of several."""
    places = np.unique(site.samples.place)
    if not site.sessions or len(places) < 2:
        return
    for place in places:
        mine = np.asarray(site.samples.session)[site.samples.place == place]
        later = [int(s) for s in np.unique(mine)[1:]]
        name = site.setup.place_names[int(place)]
        steps = [
            Parameter(
                f"fixture_{name}_{a}_session{s}", "m", STEP, f"{name} along {a}, session {s}",
                transform_move(k, MountedAnew(int(place), s)),
            )
            for s in later
            for k, a in enumerate("xyz")
        ]  # fmt: skip
        if steps:
            sentence = f"{name}: stands otherwise after it was mounted anew, {{size}}"
            yield effect_of("remounting", name, steps, sentence, LARGEST_STEP, ESTIMATED, False)
