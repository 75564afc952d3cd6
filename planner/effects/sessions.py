"""What changes between sessions: the gauge's zero, the frame it stands in, a fixture that was mounted anew."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import register
from planner.effects.context import Context
from planner.effects.effect import Effect, Place
from planner.effects.excitation import Excitation
from planner.effects.parameters import Parameter, reading_move, transform_move

STEP, LARGEST_STEP = 5e-5, 5e-3  # [m]
TURN, LARGEST_TURN = 1e-4, 1e-2  # [rad]


@dataclass(frozen=True)
class InSession(BasisFunction, key="session:INDEX", static=False, run=True):
    """φ = 1 in one session, else 0."""

    session: int
    uncorrected = "steps between sessions"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray(c.samples.session == self.session, dtype=float)

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the session."""
        return _session_variable(c)


@dataclass(frozen=True)
class PlaceInSession(BasisFunction, key="remounted:INDEX:INDEX", static=False, gauge=True, run=True):
    """φ = 1 at one place in one session, else 0: where a fixture stands after it was mounted anew."""

    place: int
    session: int

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray((c.samples.session == self.session) & (c.samples.place == self.place), dtype=float)

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the session."""
        return _session_variable(c)


def _session_variable(c: Context) -> EffectVariable:
    assert c.samples.session is not None
    return EffectVariable("session", c.samples.session.astype(float))


@register("session step", needs="poses measured in several sessions, the bar taken off in between")
def session_step(run: Excitation) -> Iterator[Effect]:
    """In every session the bar's zero is another one, and base and gauge stand otherwise to each other."""
    if not run.sessions:
        return
    if run.setup.gauge.has_zero:
        zeros = tuple(
            Parameter(f"zero_session{s}", "m", STEP, f"step of the zero in session {s}", reading_move(InSession(s)))
            for s in run.sessions
        )
        sentence = "the gauge's zero steps from session to session, {size}"
        yield _step("session step", "gauge", zeros, sentence)
    shifts = _frame_steps(run.sessions, "base_{}_session{}", "base along {}, session {}", InSession)
    yield _step("session step", "base", shifts, "the base shifts against the gauge from session to session, {size}")
    tilts = _frame_steps(run.sessions, "base_r{}_session{}", "base tilt along {}, session {}", InSession, turn=True)
    yield _step("session step", "base tilt", tilts, "the base tilts against the gauge from session to session, {size}")


@register("remounting", needs="poses measured in several sessions, the fixture mounted anew in between")
def remounting(run: Excitation) -> Iterator[Effect]:
    """A fixture, plate or station that stands otherwise each time it was mounted, one of several."""
    places = np.unique(run.samples.place)
    if not run.sessions or len(places) < 2:
        return
    for place in (int(p) for p in places):
        mine = np.asarray(run.samples.session)[run.samples.place == place]
        later = tuple(int(s) for s in np.unique(mine)[1:])
        name = run.setup.place_names[place]

        def phi(session: int, place: int = place) -> BasisFunction:
            return PlaceInSession(place, session)

        steps = _frame_steps(later, f"fixture_{name}_{{}}_session{{}}", f"{name} along {{}}, session {{}}", phi)
        if steps:
            yield _step("remounting", name, steps, f"{name}: stands otherwise after it was mounted anew, {{size}}")


def _frame_steps(
    sessions: tuple[int, ...], name: str, what: str, phi: Callable[[int], BasisFunction], turn: bool = False
) -> tuple[Parameter, ...]:
    """Steps of the base along, or about, each axis in each session; ``name`` and ``what`` take axis and session."""
    unit, prior, first = ("rad", TURN, 3) if turn else ("m", STEP, 0)
    return tuple(
        Parameter(name.format(a, s), unit, prior, what.format(a, s), transform_move(first + k, phi(s)))
        for s in sessions
        for k, a in enumerate("xyz")
    )


def _step(kind: str, part: str, parameters: tuple[Parameter, ...], sentence: str) -> Effect:
    largest = LARGEST_TURN if parameters[0].unit == "rad" else LARGEST_STEP
    return Effect(kind, Place(part), parameters, sentence, largest, "estimated", static=False)
