"""What changes between sessions: the gauge's zero, the frame it stands in, a fixture that was mounted anew."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from planner.common.units import Array
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import Excitation, register
from planner.effects.context import Context
from planner.effects.effect import BASE_SHIFTS, BASE_TURNS, BaseMotion, Effect, Parameter, Place, reading_move
from planner.effects.sizes import SESSION_SHIFT, SESSION_TURN


def session_variable(phi: BasisFunction, c: Context) -> EffectVariable:
    """Draw an effect against the session."""
    assert c.samples.session is not None
    return EffectVariable("session", c.samples.session.astype(float))


class InSession(BasisFunction, key="session:INDEX", static=False, run=True, column="session"):
    """φ = 1 in one session, else 0."""

    session: int
    uncorrected = "steps between sessions"
    plot_variable = session_variable

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray(c.samples.session == self.session, dtype=float)


class PlaceInSession(BasisFunction, key="remounted:INDEX:INDEX", static=False, gauge=True, run=True, column="session"):
    """φ = 1 at one place in one session, else 0: where a fixture stands after it was mounted anew."""

    place: int
    session: int
    plot_variable = session_variable

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray((c.samples.session == self.session) & (c.samples.place == self.place), dtype=float)


SESSION_STEP = "session step"


@register(SESSION_STEP, needs="poses measured in several sessions, the bar taken off in between")
def session_step(run: Excitation) -> Iterator[Effect]:
    """Yield the effect of setting up again: each session has its own zero of the bar and its own place of the base."""
    if not run.sessions:
        return
    if run.setup.gauge.has_zero:
        zeros = tuple(
            Parameter(
                f"zero_session{s}",
                "m",
                SESSION_SHIFT.usual,
                f"step of the zero in session {s}",
                reading_move(InSession(s)),
            )
            for s in run.sessions
        )
        sentence = "the gauge's zero steps from session to session, {size}"
        yield _step(SESSION_STEP, "gauge", zeros, sentence)
    shifts = _frame_steps(run.sessions, "base", "base", InSession, BASE_SHIFTS)
    yield _step(SESSION_STEP, "base", shifts, "the gauge (or the base) was moved from session to session, {size}")
    tilts = _frame_steps(run.sessions, "base", "base tilt", InSession, BASE_TURNS)
    yield _step(SESSION_STEP, "base tilt", tilts, "the gauge (or the base) was turned from session to session, {size}")


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

        steps = _frame_steps(later, f"fixture_{name}", name, partial(PlaceInSession, place), BASE_SHIFTS)
        if steps:
            yield _step("remounting", name, steps, f"{name}: stands otherwise after it was mounted anew, {{size}}")


def _frame_steps(
    sessions: tuple[int, ...], label: str, what: str, phi: Callable[[int], BasisFunction],
    motions: Sequence[BaseMotion],
) -> tuple[Parameter, ...]:  # fmt: skip
    """Steps of the base by some motions in each session."""
    unit, prior = ("rad", SESSION_TURN.usual) if motions == BASE_TURNS else ("m", SESSION_SHIFT.usual)
    return tuple(
        Parameter(f"{label}_{m.name}_session{s}", unit, prior, f"{what} along {m.name[-1]}, session {s}",
                  m.times(phi(s)))
        for s in sessions for m in motions
    )  # fmt: skip


def _step(kind: str, part: str, parameters: tuple[Parameter, ...], sentence: str) -> Effect:
    largest = SESSION_TURN.largest if parameters[0].unit == "rad" else SESSION_SHIFT.largest
    return Effect(kind, Place(part), parameters, sentence, largest, "estimated")
