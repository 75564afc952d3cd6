"""What would tell two effects apart that the cell's poses cannot: other loads, speeds, fixtures and bars are tried."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup
from planner.common.errors import NoSolutionError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array, to_mm
from planner.design.assumptions import ALIKE_SHARE, LOG_LIKELIHOOD_EVIDENCE, OTHER_MEASUREMENT_FACTOR, UNSAID_PAYLOAD
from planner.design.candidates.pool import draw_candidates
from planner.design.discrimination.criterion import PoolCoordinates, noncentrality
from planner.design.discrimination.questions import PredictedReadings, QuestionSet, RivalPair, candidate_visits
from planner.effects.effect import Parameter
from planner.effects.gauge_unknowns import unknowns_of
from planner.runs.run import FIRST_MOUNTING, Samples

NEW = "another"  # name of that fixture


@dataclass(frozen=True)
class OtherMeasurement:
    """Another way to measure: in words, how the readings are seen then, and parameters that come with it."""

    words: str
    sight: PredictedReadings
    more: tuple[Parameter, ...] = ()

    def tells(self, asked: QuestionSet, pair: RivalPair, poses: int) -> bool:
        """Tell whether this many poses would separate two rivals, whichever of them is true."""
        rows = self.sight.rows((*asked.parameters, *self.more))
        frame = PoolCoordinates.of(rows)
        whole = np.eye(frame.to.shape[1]) * (poses / len(rows))
        new = np.arange(len(asked.parameters), rows.shape[2])
        for question in pair.questions:
            q = replace(question, base=np.concatenate([question.base, new]))
            left, all_ = (noncentrality(frame, whole, q, beside)[0] for beside in (True, False))
            if left < OTHER_MEASUREMENT_FACTOR * max(LOG_LIKELIHOOD_EVIDENCE, ALIKE_SHARE * all_):
                return False
        return True


@dataclass(frozen=True)
class OtherMeasurements:
    """Other ways of measuring ``n`` poses, tried only when there is a pair that needs them."""

    cell: Cell
    sight: PredictedReadings
    scale: float
    n: int
    seed: int
    limit: TimeLimit = UNLIMITED

    @cached_property
    def measurements(self) -> tuple[OtherMeasurement, ...]:
        """All other measurements that were looked at."""
        return tuple(propose_measurements(self.cell, self.sight, self.scale, self.n, self.seed, self.limit))

    def help(self, asked: QuestionSet, pair: RivalPair) -> tuple[str, ...]:
        """The measurements that would tell a pair apart, in words."""
        return tuple(way.words for way in self.measurements if way.tells(asked, pair, self.n))


def propose_measurements(
    cell: Cell, sight: PredictedReadings, scale: float, poses: int, seed: int, limit: TimeLimit = UNLIMITED
) -> Iterator[OtherMeasurement]:
    """Yield ways of measuring otherwise; ``scale``: noise in the model's."""
    few = sight.thin_candidates()
    kilograms = cell.robot.payload or UNSAID_PAYLOAD
    words = f"another payload (say {kilograms:g} kg) at half of the poses, payload_kg in the run"
    yield OtherMeasurement(words, few.repeat(payload=(0.0, kilograms)))
    if few.samples[0].speed is not None:
        yield OtherMeasurement("half of the poses at another speed", few.repeat(speed=(1.0, 0.5)))
        if not cell.motion.both_ways:
            back = tuple(replace(s, speed=-np.asarray(s.speed)) for s in few.samples)
            yield OtherMeasurement(
                "driving the path both ways (motion.both_ways = true)", replace(few, samples=few.samples + back)
            )
    if few.model.setup.gauge.is_attached:
        yield from _second_fixture(cell, few, scale, poses, seed, limit)
        # 1.5: a bar half as long again
        longer = replace(cell, gauge=replace(cell.gauge, length_max=1.5 * cell.gauge.length_max))
        samples = _draw_visits(longer, poses, seed, limit)
        if samples:
            yield OtherMeasurement(f"a longer {cell.gauge.noun}", PredictedReadings.of(few.model, samples, scale))


def _second_fixture(
    cell: Cell, few: PredictedReadings, scale: float, poses: int, seed: int, limit: TimeLimit
) -> Iterator[OtherMeasurement]:
    cell = cell.restrict_to(FIRST_MOUNTING).with_mount(FIRST_MOUNTING, None)
    first = cell.fixtures[0]
    for turn in (0.9, -0.9, 1.8, -1.8):  # [rad] about the base's axis
        R = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        fixture = replace(first, p_BX=R @ first.p_BX)
        samples = _draw_visits(replace(cell, fixtures=(fixture,)), poses, seed, limit)
        if not samples:
            continue
        setup = few.model.setup
        model = replace(few.model, setup=_add_place(setup, fixture.p_BX))
        there = tuple(replace(s, place=np.full(len(s), len(setup.p_BX))) for s in samples)
        both = tuple(Samples.concatenate((a, b)) for a, b in zip(few.samples, there, strict=True))
        placed = unknowns_of(model.setup.gauge).parameters(model.setup, frozenset({"fixture"}))
        more = tuple(p for p in placed if p.name.startswith(f"fixture_{NEW}_"))
        place = ", ".join(f"{v:.0f}" for v in to_mm(fixture.p_BX))
        yield OtherMeasurement(
            f"a second fixture, say at [{place}] mm",
            PredictedReadings.of(model, both, scale),
            more,
        )
        return


def _add_place(setup: MeasurementSetup, p_BX: Array) -> MeasurementSetup:
    n = len(setup.p_BX) + 1
    return replace(
        setup,
        p_BX=np.vstack([setup.p_BX, p_BX]),
        R_BG=np.broadcast_to(np.eye(3), (n, 3, 3)),
        p_BG=np.zeros((n, 3)),
        place_names=(*setup.place_names, NEW),
        place_prior=np.append(setup.place_prior, setup.place_prior[0]),
    )


def _draw_visits(cell: Cell, poses: int, seed: int, limit: TimeLimit) -> tuple[Samples, ...]:
    """Visits of candidates of another cell; none where it has none."""
    try:
        # 800: candidates: enough to say whether it would help
        return candidate_visits(
            cell.without_twist, draw_candidates(cell.without_twist, 800, seed, limit=limit), poses, seed
        )
    except NoSolutionError:
        return ()
