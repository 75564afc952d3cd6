"""The questions of a discrimination design: for each finding and rival, what would show if either were the truth."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.units import Array, read_only
from planner.design.assumptions import NEW_SPAN_SHARE, REMEMBERED_POSES, SECONDS_BETWEEN_POSES
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.findings import IdentificationResult, IdentifiedEffect
from planner.design.discrimination.search import DiscriminationQuestion, orthonormal_span
from planner.design.observability.information import stack_rows
from planner.effects.catalogue import catalogue, needs_of
from planner.effects.effect import Effect, Parameter
from planner.model.model import Model
from planner.runs.run import Samples


@dataclass(frozen=True)
class PredictedReadings:
    """How readings depend on parameters: a model, and samples of every candidate, with the noise of each.

    Attributes:
        model: the plan's own parameters.
        samples: one set for each visit of the candidates, see :func:`candidate_visits`.
        sigma: noise of one reading, (n,) [m].
    """

    model: Model
    samples: tuple[Samples, ...]
    sigma: Array

    @classmethod
    def of(cls, model: Model, samples: tuple[Samples, ...], scale: float) -> "PredictedReadings":
        """Take the noise of the model's gauge times ``scale``."""
        return cls(model, samples, np.asarray(scale * model.reading_noise(samples[0]).std))

    def repeat(self, **change: tuple[float, float]) -> "PredictedReadings":
        """Return all visits twice, see :func:`repeat_visits`."""
        twice = tuple(repeat_visits(s, **change) for s in self.samples)
        return replace(self, samples=twice, sigma=np.tile(self.sigma, 2))

    def entries(self) -> dict[str, Effect]:
        """Every effect that these samples can show, by name."""
        return {e.name: e for e in catalogue(self.model.setup, Samples.concatenate(self.samples))}

    def rows(self, parameters: Sequence[Parameter]) -> Array:
        """Whitened rows of every candidate, (n, r, P), per unit of the parameters; r numbers over all visits."""
        model = replace(self.model, parameters=tuple(parameters))
        whole = np.concatenate([model.rows(s) for s in self.samples], axis=1)
        return np.asarray(whole / self.sigma[:, None, None])

    def thin_candidates(self) -> "PredictedReadings":
        """Return a few of the candidates, evenly over all."""
        return self.at(even_positions(len(self.sigma), 1_500))  # 1500 candidates are enough to find an inner number by

    def at(self, which: np.ndarray) -> "PredictedReadings":
        """Return only some of the candidates."""
        return PredictedReadings(self.model, tuple(s.take(which) for s in self.samples), self.sigma[which])


def project_out(columns: Array, basis: Array) -> Array:
    """Return columns (m, k) less their projection on an orthonormal basis (m, p)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def found_values(found: IdentifiedEffect, parameters: Sequence[Parameter], values: dict[str, float]) -> Array:
    """Found values of an effect's parameters, (k,): by name, else the finding's size on the first of them."""
    out = np.array([values.get(p.name, 0.0) for p in parameters])
    if not np.any(out):
        out[0] = found.size
    return out


def best_matching_inner(sight: PredictedReadings, entry: Effect, signal: Array, base: Array) -> float | None:
    """Inner number with which an entry explains most of a signal (n r,); ``None`` where there is none.

    Args:
        sight: few candidates.
        entry: the entry.
        signal: of which it is to explain as much as it can, after the base took its part.
        base: orthonormal basis (n r, p) of what is in the model anyway.
    """
    if entry.nonlinear is None:
        return None
    grid = entry.nonlinear.values
    value = _best_on_grid(sight, entry, signal, base, grid)
    near = int(np.argmin(np.abs(grid - value)))
    width = float(max(np.abs(np.diff(grid[max(0, near - 1) : near + 2]))))
    for _ in range(3):  # rounds, each five times finer: to a hundredth of the grid's step
        tries = np.clip(value + width * np.linspace(-1, 1, 11), grid.min(), grid.max())
        value = _best_on_grid(sight, entry, signal, base, np.unique(tries))
        width /= 5
    return value


def _best_on_grid(sight: PredictedReadings, entry: Effect, signal: Array, base: Array, grid: Array) -> float:
    columns_at_once = 300  # columns: a few MB
    shares: list[float] = []
    each = len(entry.make(float(grid[0])))
    for start in range(0, len(grid), max(1, columns_at_once // each)):
        part = grid[start : start + max(1, columns_at_once // each)]
        columns = stack_rows(sight.rows([p for v in part for p in entry.make(float(v))]))
        left = project_out(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), base)
        for k in range(len(part)):
            own = left[:, k * each : (k + 1) * each]
            shares.append(float(np.sum((own @ np.linalg.lstsq(own, signal, rcond=1e-6)[0]) ** 2)))
    return float(grid[int(np.argmax(shares))])


def candidate_visits(cell: Cell, pool: PoseSet, poses: int, seed: int) -> tuple[Samples, ...]:
    """Return the samples that one visit of each candidate gives: one at rest; in motion one for each way driven.

    Which pose comes before is not known before the tour is: each candidate is taken to be come to from another one,
    and at any time of the run.
    """
    rng = np.random.default_rng([seed, 5])
    before = pool.q[rng.permutation(len(pool))]
    way = pool.q - before
    t = rng.random(len(pool)) * poses * (SECONDS_BETWEEN_POSES + cell.rest_seconds)
    at = replace(pool.samples, t=read_only(t))
    if not cell.motion.is_continuous:
        return (replace(at, direction=read_only(np.sign(way))),)
    speed = _measuring_speed(cell, pool.q, way)
    earlier = [pool.q[rng.permutation(len(pool))] for _ in range(REMEMBERED_POSES)]
    there = replace(at, speed=read_only(speed), reversals=read_only(np.stack([*earlier, before], axis=2)))
    if not cell.motion.both_ways:
        return (there,)
    turned = read_only(np.stack([*earlier, pool.q + way], axis=2))
    return there, replace(there, t=read_only(2 * t.max() - t), speed=read_only(-speed), reversals=turned)


def repeat_visits(samples: Samples, **change: tuple[float, float]) -> Samples:
    """All visits twice: a column that is there times either number, or else the numbers themselves."""
    n = len(samples)
    twice = samples.take(np.tile(np.arange(n), 2))
    columns = {}
    for name, pair in change.items():
        factor, now = np.repeat(pair, n), getattr(twice, name)
        columns[name] = read_only(factor if now is None else now * factor[:, None])
    return replace(twice, **columns)


def approach_both_sides(samples: Samples) -> Samples:
    """Return the visits at rest (n), and the same with every axis come from the other side (n more)."""
    return repeat_visits(samples, direction=(1.0, -1.0))


def _measuring_speed(cell: Cell, q: Array, way: Array) -> Array:
    """Speeds (n, N) [rad/s] along the ways (n, N) with the tool at measuring speed, no axis faster than it can."""
    tool = np.linalg.norm(np.einsum("nij,nj->ni", cell.map_jacobian(q), way), axis=1)
    axis = (np.abs(way) / cell.robot.speed).max(axis=1)
    seconds = np.maximum(tool / cell.motion.tool_speed, axis)
    return np.asarray(way / np.maximum(seconds, 1e-9)[:, None])


def approach_axes(identified: IdentificationResult, cell: Cell) -> tuple[int, ...]:
    """Axes whose side of approach a pose at rest must be come to from: those whose play is in question."""
    if cell.motion.is_continuous:
        return ()
    names = {n for f in identified.found if f.rivals for n in (f.name, *f.rivals)}
    return tuple(i for i in range(cell.robot.n_joints) if f"backlash, joint {i + 1}" in names)


def approach_signs(samples: Samples, axes: tuple[int, ...]) -> np.ndarray:
    """Wanted signs (n, N) of the last movement of some axes, 0 for the others."""
    assert samples.direction is not None
    out = np.zeros(samples.q.shape, dtype=int)
    out[:, axes] = samples.direction[:, axes]
    out.setflags(write=False)
    return out


def effect_kind(name: str) -> str:
    """Return the kind of an effect, from its name ``KIND, PLACE``."""
    return name.split(", ")[0]


@dataclass(frozen=True)
class RivalPair:
    """A truth and what may be taken for it.

    Attributes:
        finding, rival: names.
        questions: one for either truth where the identification names the rival; else one, for the finding.
        named: whether the identification names the rival; else it is one that these poses would bring up.
    """

    finding: str
    rival: str
    questions: tuple[DiscriminationQuestion, ...]
    named: bool = True


@dataclass(frozen=True)
class QuestionSet:
    """All that is asked.

    Attributes:
        parameters: of all columns: the plan's own first, then those of findings and rivals.
        own: positions of the plan's own.
        pairs: what is to be told apart.
        not_shown: a sentence for each pair whose effects the plan's readings cannot show at all.
        places: positions of the columns of each effect at an inner number.
    """

    parameters: tuple[Parameter, ...]
    own: np.ndarray
    pairs: tuple[RivalPair, ...] = ()
    not_shown: tuple[str, ...] = ()
    places: Mapping[tuple[str, float | None], np.ndarray] = field(default_factory=dict)

    def with_effect(self, entry: Effect, inner: float | None) -> "tuple[QuestionSet, np.ndarray]":
        """Return the questions with the columns of one more effect (added once), and the positions of its columns."""
        key = (entry.name, inner)
        if key in self.places:
            return self, self.places[key]
        parameters = (*self.parameters, *entry.make(inner))
        where = np.arange(len(self.parameters), len(parameters))
        return replace(self, parameters=parameters, places={**self.places, key: where}), where

    def with_pair(self, pair: RivalPair) -> "QuestionSet":
        """Return the questions with those of one more pair."""
        return replace(self, pairs=(*self.pairs, pair))

    def with_rival(self, question: DiscriminationQuestion, entry: Effect, inner: float | None) -> "QuestionSet":
        """Return the questions with one more: are readings taken for ``entry`` where ``question.truth`` is true?"""
        more, where = self.with_effect(entry, inner)
        return more.with_pair(RivalPair(question.truth, entry.name, (replace(question, rival=where),), False))


def pose_questions(
    sight: PredictedReadings, entries: Mapping[str, Effect], identified: IdentificationResult
) -> QuestionSet:
    """Return the questions for an identification's findings and their rivals."""
    few = sight.thin_candidates()
    asked = QuestionSet(sight.model.parameters, np.arange(len(sight.model.parameters)))
    known = [(f, entries[f.name]) for f in identified.found if f.name in entries and not _is_band(f, entries)]
    places = []
    for found, entry in known:
        asked, where = asked.with_effect(entry, found.inner)
        places.append(where)
    for k, (found, entry) in enumerate(known):
        values = found_values(found, entry.make(found.inner), identified.values)
        others = [p for j, p in enumerate(places) if j != k]
        for name in (r for r in found.rivals if r in entries):
            rival = entries[name]
            base = np.concatenate([_own_columns_without(asked, entry, rival), *others])
            taken = orthonormal_span(stack_rows(few.rows([asked.parameters[i] for i in base])), NEW_SPAN_SHARE)
            signal = project_out(stack_rows(few.rows(entry.make(found.inner))) @ values[:, None], taken)[:, 0]
            inner = best_matching_inner(few, rival, signal, taken)
            matching = _match_signal(project_out(stack_rows(few.rows(rival.make(inner))), taken), signal)
            asked, there = asked.with_effect(rival, inner)
            here = places[k]
            either = (
                DiscriminationQuestion(found.label, here, values, base, there),
                DiscriminationQuestion(name, there, matching, base, here),
            )
            asked = asked.with_pair(RivalPair(found.label, name, either))
    return replace(asked, not_shown=tuple(s for f in identified.found for s in _explain_unseen(f, entries)))


def _is_band(found: IdentifiedEffect, entries: Mapping[str, Effect]) -> bool:
    """Tell whether the posterior holds an effect at some values of its inner number together, none by itself."""
    return found.inner is None and found.name in entries and entries[found.name].nonlinear is not None


def _own_columns_without(asked: QuestionSet, *entries: Effect) -> np.ndarray:
    """The plan's own columns, less those that are an entry's themselves: joint compliances may be among them."""
    made = {p.moves for e in entries if e.nonlinear is None for p in e.make(None)}
    return np.array([k for k in asked.own if asked.parameters[k].moves not in made], dtype=int)


def _match_signal(columns: Array, signal: Array) -> Array:
    """Values of a rival's parameters (k,) that look most like the signal and show as much as it does."""
    values = np.linalg.lstsq(columns, signal, rcond=1e-6)[0]
    shown = float(np.linalg.norm(columns @ values))
    if shown <= 1e-6 * float(np.linalg.norm(signal)):  # nothing in common: any direction will do, of the signal's size
        values = np.ones(columns.shape[1])
        shown = float(np.linalg.norm(columns @ values))
    return np.asarray(values * (float(np.linalg.norm(signal)) / max(shown, 1e-300)))


def _explain_unseen(found: IdentifiedEffect, entries: Mapping[str, Effect]) -> Iterator[str]:
    """Say of each rival that a plan's readings do not show one of the two at all."""
    if _is_band(found, entries):
        inner = entries[found.name].nonlinear
        what = "number" if inner is None else inner.name
        if found.rivals:
            yield f"{found.label}: the runs show a band of it, and no one {what} to choose poses for"
        return
    for rival in found.rivals:
        missing = [name for name in (found.name, rival) if name not in entries]
        if missing:
            needs = dict.fromkeys(needs_of(effect_kind(name)) for name in missing)
            what = f"{found.label} and {rival}: a run of this plan does not show {' and '.join(missing)}"
            yield f"{what}; that needs {' and '.join(needs)}"
