"""``separate()``: choose the poses that tell the findings of an identification from their rivals."""

from dataclasses import dataclass, replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.choice import Choice
from planner.errors import NoSolutionError
from planner.repeatable import Places, single_threaded
from planner.run import Samples
from planner.separating.bounding import Bound, bound, check
from planner.separating.columns import Sight
from planner.separating.criterion import Criterion, criterion
from planner.separating.exchanging import descend, exchange, information
from planner.separating.file import Identified
from planner.separating.frame import Frame
from planner.separating.judging import judged, sentence, separable
from planner.separating.newcomers import newcomers
from planner.separating.pairs import Asked, ask
from planner.separating.passages import from_both_sides, passages
from planner.separating.remedies import Ways
from planner.separating.sides import sides_asked, wanted_sides
from planner.separating.types import UNSURE, Separation, Told
from planner.units import Array

ROUNDS = 3  # of choosing, and taking up the rivals that the chosen poses would bring up
UNNAMED = 0.5  # weight of such a rival; all of them together weigh no more than half of those that are named


@dataclass(frozen=True)
class Separated:
    """The choice, and all that is needed to judge other poses of the same plan.

    ``scale``: noise as the identification left it, in the model's.
    """

    choice: Choice
    separation: Separation
    asked: Asked
    frame: Frame
    scale: float

    def as_driven(self, samples: tuple[Samples, ...]) -> Separation:
        """Judge the visits of the finished plan: samples of each, for every way on which it is passed."""
        model, first = self.choice.model, samples[0]
        sigma = self.scale * model.noise_of(first)
        rows = Sight(model, samples, np.asarray(sigma)).rows(self.asked.parameters)
        now = judged(self.asked, self.frame, information(self.frame.rows(rows)))
        sizes = {(p.finding, p.rival): size for p, size in zip(self.asked.pairs, now, strict=True)}
        told = (replace(t, noncentrality=s[0], power=s[1]) for t in self.separation.told for s in [sizes[t.pair]])
        return replace(self.separation, told=tuple(told))


@dataclass(frozen=True)
class _Chosen:
    """Candidates, the criterion by which they were chosen, and its bound."""

    places: Places
    aim: Criterion
    bound: Bound


@single_threaded
def separate(cell: Cell, pool: PoseSet, choice: Choice, identified: Identified, seed: int) -> Separated:
    """Choose as many candidates as ``choice`` has, to tell every finding from its rivals.

    Raises:
        NoSolutionError: no poses can tell any of them from any rival.
    """
    noise = identified.noise(choice.model.width)
    sides = sides_asked(identified, cell)
    sight, scale = _sight(cell, pool, choice, noise, bool(sides), seed)
    group = np.arange(len(sight.sigma)) % len(pool)
    entries = sight.entries()
    asked = ask(sight, entries, identified)
    frame, rows = _seen(sight, asked)
    open_, closed = separable(asked, frame, rows, len(choice.chosen))
    other_ways = Ways(cell, sight, scale, len(choice.chosen), seed)
    sentences = asked.not_shown + tuple(
        sentence(asked, c, other_ways.n, other_ways.help(asked, c.pair)) for c in closed
    )
    if not open_:
        raise NoSolutionError(
            f"{identified.path}: no poses of this cell tell any finding from its rivals: {'; '.join(sentences)}"
        )
    places = choice.chosen
    for _ in range(ROUNDS):
        places = descend(rows, _aim(frame, asked, open_), places, group)
        asked, new = newcomers(sight, entries, asked, set(open_), places)
        if not new:
            break
        frame, rows = _seen(sight, asked)
        open_ |= separable(asked, frame, rows, len(places), new)[0]
    done = _chosen(rows, _aim(frame, asked, open_), places, seed, group)
    now, before = (judged(asked, frame, information(rows[k])) for k in (done.places, choice.chosen))
    separation = Separation(
        _told(asked, open_, now, before, other_ways),
        sentences,
        len(done.places),
        float(np.expm1(done.bound.value - done.aim.value(information(rows[done.places])))),
        check(done.bound, rows),
        noise,
        choice.value,
    )
    kept = _moved(choice, pool, done.places % len(pool))
    if sides:
        kept = replace(kept, approach=wanted_sides(sight.samples[0].take(done.places), sides))
    return Separated(kept, separation, asked, frame, scale)


def _sight(cell: Cell, pool: PoseSet, choice: Choice, noise: float, both_sides: bool, seed: int) -> tuple[Sight, float]:
    """How the candidates are seen, come to from both sides where that counts; and ``noise`` in the model's."""
    samples = passages(cell, pool, len(choice.chosen), seed)
    if both_sides:
        samples = tuple(from_both_sides(s) for s in samples)
    sigma = choice.model.noise_of(samples[0])
    scale = noise / float(np.sqrt(np.mean(sigma**2)))
    return Sight(choice.model, samples, np.asarray(scale * sigma)), scale


def _seen(sight: Sight, asked: Asked) -> tuple[Frame, Array]:
    """Well-conditioned coordinates of all columns, and the rows (n, r, p) of all candidates in them."""
    rows = sight.rows(asked.parameters)
    frame = Frame.of(rows)
    return frame, frame.rows(rows)


def _aim(frame: Frame, asked: Asked, open_: dict[int, float]) -> Criterion:
    """The criterion for the pairs that poses can tell apart; rivals that nobody named count less."""
    questions = [q for q in asked.questions if q.pair in open_]
    named = np.array([asked.pairs[q.pair].named for q in questions])
    weights = np.where(named, 1.0, UNNAMED * min(1.0, named.sum() / max(1, (~named).sum())))
    return criterion(frame, asked.own, questions, weights)


def _chosen(rows: Array, aim: Criterion, start: Places, seed: int, group: Places) -> _Chosen:
    found = bound(rows, aim, len(start), start)
    return _Chosen(exchange(rows, aim, found, start, seed, group), aim, found)


def _told(
    asked: Asked,
    open_: dict[int, float],
    now: list[tuple[float, float]],
    before: list[tuple[float, float]],
    other_ways: Ways,
) -> tuple[Told, ...]:
    out = []
    for k, pair in enumerate(asked.pairs):
        if k in open_:
            help_ = other_ways.help(asked, k) if pair.named and now[k][1] < UNSURE else ()
            out.append(Told(pair.finding, pair.rival, pair.named, *now[k], before[k][0], open_[k], help_))
    return tuple(out)


def _moved(choice: Choice, pool: PoseSet, chosen: Places) -> Choice:
    """The choice with the separating candidates in place of its own."""
    there = replace(choice, fixture=pool.fixture[chosen])
    return there.with_poses(pool.q[chosen], chosen, pool)
