"""Bars and wires of several sessions, fitted as one: each session has a zero of its own, each gauge its own errors.

No cell file names this kind: it is made of the gauges of several cells (``planner.identification.joint_sessions``).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.cell.gauge_types import LeftStanding
from planner.cell.placement import P, Placement
from planner.cell.site import Site
from planner.common.units import Array
from planner.effects.basis import AtPlace
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Parameter, reading_move
from planner.effects.own_places import effect_at
from planner.gauges.bar import ZERO_SIGMA, LengthGauge
from planner.runs.run import Run, Samples


def standing_lengths(cells: Sequence[Cell]) -> list[LengthGauge]:
    """Return the gauge of each cell whose gauge reads lengths from fixtures."""
    return [c.gauge for c in cells if isinstance(c.gauge, LengthGauge) and c.fixtures]


@dataclass(frozen=True)
class SessionGauge:
    """The gauge of one session.

    Attributes:
        name: of the session, as its places are told from those of others.
        gauge: what read it.
        places: names of the fixtures at which it stood.
    """

    name: str
    gauge: LengthGauge
    places: tuple[str, ...]


@dataclass(frozen=True)
class SeveralLengths(LengthGauge):
    """Length gauges of several sessions: what a reading is, which noise it has, and what is unknown of each.

    Attributes:
        sessions: in the order in which they were measured.
        numbered: names of the fixtures as the run numbers them.
    """

    sessions: tuple[SessionGauge, ...] = ()
    numbered: tuple[str, ...] = ()

    kind: ClassVar[str] = "several"
    noun: ClassVar[str] = "gauge"
    default_noise_um: ClassVar[float] = 1.0

    @classmethod
    def of(cls, sessions: Sequence[SessionGauge]) -> "SeveralLengths":
        """Join the gauges of some sessions."""
        gauges = [s.gauge for s in sessions]
        return cls(
            noise=min(g.noise for g in gauges),
            zero_free=any(g.zero_free for g in gauges),
            length_min=min(g.length_min for g in gauges),
            length_max=max(g.length_max for g in gauges),
            cone_fixture=max(g.cone_fixture for g in gauges),
            cone_map=max(g.cone_map for g in gauges),
            trim=gauges[0].trim,
            sessions=tuple(sessions),
        )

    @property
    def scale_sigma(self) -> float:
        """One sigma of the scale of that gauge which is known worst, relative."""
        return max(s.gauge.scale_sigma for s in self.sessions)

    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with the fixtures as the run numbers them, and the gauge that knows which is whose."""
        found = super().number_places(setup, cell, run)
        gauge = replace(self, numbered=found.place_names)
        return replace(found, gauge=gauge) if isinstance(found, MeasurementSetup) else found

    def lasting_places(self, setup: Placement) -> dict[str, Array] | None:
        """Return none: fixtures of several sessions are not all there when the robot is checked."""
        return None

    def kept_mounting(self, setup: Placement) -> LeftStanding:
        """Return the fixtures and the zero of the last session, as its own cell calls them."""
        last, zeros = self.sessions[-1], list(self.zero_parameters(setup))
        own = {name: name.removeprefix(f"{last.name}/") for name in last.places}
        places = {own[n]: p for n, p in zip(setup.place_names, setup.p_BX, strict=True) if n in own}
        names = {f"fixture_{n}_{axis}": f"fixture_{called}_{axis}" for n, called in own.items() for axis in "xyz"}
        return LeftStanding(names | ({zeros[-1].name: "zero"} if last.gauge.zero_free and zeros else {}), places)

    def sigmas_of(self, samples: Samples) -> Array:
        """Return the noise of the gauge that took each reading, (n, 1) [m]."""
        noise = np.zeros(max(len(self.numbered), 1))
        for session in self.sessions:
            noise[self._places_of(session)] = session.gauge.noise
        return np.asarray(noise[samples.place][:, None])

    def zero_parameters(self, setup: Placement) -> Iterator[Parameter]:
        """Yield a zero of each session, since it is set anew there; the first has the name of a single one."""
        for k, session in enumerate(self.sessions, start=1):
            moves = tuple(m for place in self._places_of(session) for m in reading_move(AtPlace(place)))
            if session.gauge.zero_free and moves:
                name = "zero" if k == 1 else f"zero_{k}"
                what = f"zero of the {session.gauge.noun} in {session.name}"
                yield Parameter(name, "m", ZERO_SIGMA, what, moves, "gauge")

    def errors(self, run: Excitation) -> Iterator[Effect]:
        """Yield the errors of each gauge, at the fixtures where it stood."""
        gauges = list(dict.fromkeys(s.gauge for s in self.sessions))
        for gauge in gauges:
            own = [s for s in self.sessions if s.gauge == gauge]
            places = [place for s in own for place in self._places_of(s)]
            there = np.isin(run.samples.place, places)
            if not there.any():
                continue
            seen = Excitation(replace(run.setup, gauge=gauge), run.samples.take(there))
            alone = len(gauges) == 1
            label = gauge.noun if [g.noun for g in gauges].count(gauge.noun) == 1 else own[0].name
            yield from (e if alone else effect_at(e, places, label) for e in gauge.errors(seen))

    def _places_of(self, session: SessionGauge) -> list[int]:
        """Numbers of the places of a session."""
        return [k for k, name in enumerate(self.numbered) if name in session.places]
