"""The poses that tell the findings of an identification from their rivals.

What would tell two effects apart that the cell's poses cannot: other loads, speeds, fixtures and bars are tried.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.common.determinism import Positions, on_one_thread
from planner.common.errors import NoSolutionError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array, to_mm
from planner.design.assumptions import (
    ALIKE_SHARE,
    INDUCED_RIVALS_PER_TRUTH,
    INDUCED_WEIGHT,
    LOG_LIKELIHOOD_EVIDENCE,
    NEW_SPAN_SHARE,
    OTHER_MEASUREMENT_FACTOR,
    SURE_POWER,
    UNSAID_PAYLOAD,
    UNSURE_POWER,
    VISIBLE_SHARE,
)
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.discrimination.findings import IdentificationResult
from planner.design.discrimination.power import (
    Discrimination,
    PairPower,
    discrimination_power,
    explain_inseparable,
    pair_powers,
    split_separable,
)
from planner.design.discrimination.questions import (
    PredictedReadings,
    QuestionSet,
    RivalPair,
    approach_axes,
    approach_both_sides,
    approach_signs,
    candidate_visits,
    pose_questions,
    project_out,
)
from planner.design.discrimination.search import (
    DTCriterion,
    DTSwaps,
    PoolCoordinates,
    bound_criterion,
    dt_criterion,
    exchange_by_criterion,
    noncentrality,
    orthonormal_span,
)
from planner.design.observability.information import stack_rows
from planner.design.pose_selection import PoseChoice
from planner.design.selection.matrix_forms import information_matrix
from planner.design.selection.search import descend
from planner.effects.effect import Effect, Parameter, Role
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
        yield OtherMeasurement(f"a second fixture, say at [{place}] mm", PredictedReadings.of(model, both, scale), more)
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


@dataclass(frozen=True)
class CatalogueColumns:
    """The catalogue over some poses: entries with an inner number each, and their columns.

    Attributes:
        items: K of them.
        groups: for each number k of parameters, positions of the items (g,), and columns of unit length (g, m, k).
    """

    items: tuple[tuple[Effect, float | None], ...]
    groups: tuple[tuple[np.ndarray, Array], ...]

    @classmethod
    def of(cls, sight: PredictedReadings, entries: Mapping[str, Effect]) -> "CatalogueColumns":
        """Lay out the catalogue over the poses of a sight."""
        items = tuple((e, v) for e in entries.values() if not e.has(Role.UNTRACED) for v in e.grid)
        made = [e.make(v) for e, v in items]
        widths = np.array([len(m) for m in made])
        groups = []
        for k in np.unique(widths):
            which = np.flatnonzero(widths == k)
            columns = stack_rows(sight.rows([p for j in which for p in made[j]]))
            columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            groups.append((which, columns.reshape(len(columns), len(which), k).transpose(1, 0, 2)))
        return cls(items, tuple(groups))

    def explained_squares(self, basis: Array, signal: Array) -> Array:
        """Square of what each item explains of a signal (m,), both off an orthonormal basis (m, p) of the model."""
        out = np.zeros(len(self.items))
        for which, columns in self.groups:
            left = columns - basis @ (basis.T @ columns)
            mu, axes = np.linalg.eigh(left.transpose(0, 2, 1) @ left)
            along = np.einsum("gij,gi->gj", axes, np.einsum("gmk,m->gk", left, signal))
            out[which] = np.where(mu > VISIBLE_SHARE, along**2 / np.maximum(mu, VISIBLE_SHARE), 0.0).sum(axis=1)
        return out


def add_induced_rivals(
    sight: PredictedReadings,
    entries: Mapping[str, Effect],
    asked: QuestionSet,
    open_: Container[int],
    chosen: Positions,
) -> QuestionSet:
    """Add a question for each effect of the catalogue that readings at ``chosen`` would not tell from a truth.

    ``open_``: pairs that poses can tell apart.
    """
    few = sight.at(chosen)
    rows, dictionary = stack_rows(few.rows(asked.parameters)), CatalogueColumns.of(few, entries)
    pairs = [p for k, p in enumerate(asked.pairs) if k in open_ and p.named]
    truths = {q.truth: q for p in pairs[::-1] for q in p.questions[::-1]}
    for truth, q in sorted(truths.items()):
        basis = orthonormal_span(rows[:, q.base], NEW_SPAN_SHARE)
        signal = project_out(rows[:, q.shows] @ q.values, basis)
        whole = float(signal @ signal)
        left = whole - dictionary.explained_squares(basis, signal)
        with_it = {n for p in asked.pairs if truth in (p.finding, p.rival) for n in (p.finding, p.rival)}
        known, new = {n.split(" (")[0] for n in with_it}, set[str]()
        for k in np.argsort(left, kind="stable"):
            entry, inner = dictionary.items[k]
            if len(new) == INDUCED_RIVALS_PER_TRUTH or discrimination_power(float(left[k]), whole) > SURE_POWER:
                break
            if entry.name not in known | new:
                new.add(entry.name)
                asked = asked.with_rival(q, entry, inner)
    return asked


@dataclass(frozen=True)
class DiscriminatingChoice:
    """The choice, and all that is needed to judge other poses of the same plan.

    ``scale``: noise as the identification left it, in the model's.
    """

    choice: PoseChoice
    separation: Discrimination
    asked: QuestionSet
    frame: PoolCoordinates
    scale: float

    def judge_driven_visits(self, samples: tuple[Samples, ...]) -> Discrimination:
        """Judge the visits of the finished plan: samples of each, for every way on which it is passed."""
        rows = PredictedReadings.of(self.choice.model, samples, self.scale).rows(self.asked.parameters)
        now = pair_powers(self.asked, self.frame, information_matrix(self.frame.rows(rows)))
        sizes = {(p.finding, p.rival): size for p, size in zip(self.asked.pairs, now, strict=True)}
        told = (replace(t, noncentrality=s[0], power=s[1]) for t in self.separation.told for s in [sizes[t.pair]])
        return replace(self.separation, told=tuple(told))


@on_one_thread
def select_discriminating_poses(
    cell: Cell,
    pool: PoseSet,
    choice: PoseChoice,
    identified: IdentificationResult,
    seed: int,
    limit: TimeLimit = UNLIMITED,
) -> DiscriminatingChoice:
    """Choose as many candidates as ``choice`` has, to tell every finding from its rivals.

    Raises:
        NoSolutionError: no poses can tell any of them from any rival.
    """
    noise = identified.noise(choice.model.width)
    sides = approach_axes(identified, cell)
    sight, scale = _predict_readings(cell, pool, choice, noise, bool(sides), seed)
    group = np.arange(len(sight.sigma)) % len(pool)
    entries = sight.entries()
    asked = pose_questions(sight, entries, identified)
    frame, rows = _pool_rows(sight, asked)
    open_, closed = split_separable(asked, frame, rows, len(choice.chosen))
    other_ways = OtherMeasurements(cell, sight, scale, len(choice.chosen), seed, limit)
    sentences = asked.not_shown + tuple(
        explain_inseparable(pair, most, other_ways.n, other_ways.help(asked, pair))
        for k, most in closed.items()
        for pair in [asked.pairs[k]]
    )
    if not open_:
        raise NoSolutionError(
            f"{identified.path}: no poses of this cell tell any finding from its rivals: {'; '.join(sentences)}"
        )
    places = choice.chosen
    for _ in range(3):  # rounds of choosing and taking up the rivals that the chosen poses would bring up
        swaps = DTSwaps(rows, _make_criterion(frame, asked, open_), group)
        places = descend(swaps, places, np.arange(len(rows)), limit)
        known = len(asked.pairs)
        asked = add_induced_rivals(sight, entries, asked, open_, places)
        if len(asked.pairs) == known:
            break
        frame, rows = _pool_rows(sight, asked)
        open_ |= split_separable(asked, frame, rows, len(places), known)[0]
    aim = _make_criterion(frame, asked, open_)
    bound = bound_criterion(rows, aim, len(places), places, limit)
    places = exchange_by_criterion(rows, aim, bound, places, seed, group, limit)
    now, before = (pair_powers(asked, frame, information_matrix(rows[k])) for k in (places, choice.chosen))
    separation = Discrimination(
        tuple(_pair_powers(asked, open_, now, before, other_ways)),
        sentences,
        len(places),
        float(np.expm1(bound.value - aim.value(information_matrix(rows[places])))),
        bound.verified,
        noise,
        choice.value,
    )
    at = places % len(pool)
    kept = choice.with_candidates(pool, at)
    if sides:
        kept = replace(kept, approach=approach_signs(sight.samples[0].take(places), sides))
    return DiscriminatingChoice(kept, separation, asked, frame, scale)


def _pair_powers(
    asked: QuestionSet,
    most: Mapping[int, float],
    now: Sequence[tuple[float, float]],
    before: Sequence[tuple[float, float]],
    other_ways: OtherMeasurements,
) -> Iterator[PairPower]:
    """Yield how well each pair is told apart, with what would help where that is not sure.

    Args:
        asked: the pairs.
        most: of those that poses can tell apart, by number, the most that any poses give.
        now, before: size and power of every pair at the poses chosen, and at those of the plan without this question.
        other_ways: what else would tell them apart.
    """
    for k, bound in sorted(most.items()):
        pair, (size, power) = asked.pairs[k], now[k]
        help_ = other_ways.help(asked, pair) if pair.named and power < UNSURE_POWER else ()
        yield PairPower(pair.finding, pair.rival, pair.named, size, power, before[k][0], bound, help_)


def _predict_readings(
    cell: Cell, pool: PoseSet, choice: PoseChoice, noise: float, both_sides: bool, seed: int
) -> tuple[PredictedReadings, float]:
    """How the candidates are seen, come to from both sides where that counts; and ``noise`` in the model's."""
    samples = candidate_visits(cell, pool, len(choice.chosen), seed)
    if both_sides:
        samples = tuple(approach_both_sides(s) for s in samples)
    scale = noise / float(np.sqrt(np.mean(choice.model.reading_noise(samples[0]).std ** 2)))
    return PredictedReadings.of(choice.model, samples, scale), scale


def _pool_rows(sight: PredictedReadings, asked: QuestionSet) -> tuple[PoolCoordinates, Array]:
    """Well-conditioned coordinates of all columns, and the rows (n, r, p) of all candidates in them."""
    rows = sight.rows(asked.parameters)
    frame = PoolCoordinates.of(rows)
    return frame, frame.rows(rows)


def _make_criterion(frame: PoolCoordinates, asked: QuestionSet, open_: dict[int, float]) -> DTCriterion:
    """The criterion for the pairs that poses can tell apart; rivals that nobody named count less."""
    pairs = [p for k, p in enumerate(asked.pairs) if k in open_]
    questions = [q for p in pairs for q in p.questions]
    named = np.array([p.named for p in pairs for _ in p.questions])
    weights = np.where(named, 1.0, INDUCED_WEIGHT * min(1.0, named.sum() / max(1, (~named).sum())))
    return dt_criterion(frame, asked.own, questions, weights)
