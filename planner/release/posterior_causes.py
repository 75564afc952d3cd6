"""Causes of the catalogue that the posterior holds and no stage has: likely ones, each too faint for one of its own.

The background has them as random effects, in families. Of a family of one kind at all places with one size, such as
play, the places are told where it is clearly seen.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from planner.common.units import Array, display_unit, format_value
from planner.effects.catalogue import catalogue, effect_kinds
from planner.effects.effect import Effect
from planner.effects.nonparametric import GEAR_CURVE
from planner.fit.assumptions import STANDING_PROBABILITY
from planner.inference.candidates import Candidate, CauseComparison, Inclusion, candidates_of_same_law
from planner.inference.posterior_background import OF_BACKGROUND
from planner.inference.posterior_fit import PosteriorFit
from planner.model.finding import Finding, grade_of
from planner.release.released_robot import ReleasedRobot

OF_GEARS = ("gear ", "encoder ")  # first words of families, and of findings, that are the unevenness of one gear
GEAR_CAUSES = {
    "gear once a turn": "encoder once a turn",
    "gear twice a turn": "encoder twice a turn",
    "gear harmonics": GEAR_CURVE,
}
"""Names in the catalogue of what the background has of a gear under another one."""


@dataclass(frozen=True)
class PosteriorFamily:
    """A family of the background that is likelier to act than not.

    Attributes:
        name: of the family, as the posterior has it.
        places: the cause of the catalogue at each of its places, ``KIND, PLACE``, and the names of its parameters.
        comparison: for what it explains.
        many: of each rival that acts at many places, by its kind, these causes.
    """

    name: str
    places: Mapping[str, frozenset[str]]
    comparison: CauseComparison
    many: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def rival_at(self, name: str, place: str) -> str:
        """Return the name of a rival of the cause at a place: of a kind that acts at many, the one that acts there."""
        there = self.many.get(name, (name,))
        return next((cause for cause in there if cause.partition(", ")[2] == place), there[0])


@dataclass(frozen=True)
class _Background:
    """The families of a posterior by the causes of the catalogue."""

    posterior: PosteriorFit

    @cached_property
    def effects(self) -> dict[str, list[Effect]]:
        """The catalogue's effects that the run may show, by kind."""
        out: dict[str, list[Effect]] = {}
        for effect in catalogue(self.posterior.record.model.setup, self.posterior.record.run.samples):
            out.setdefault(effect.kind, []).append(effect)
        return out

    @cached_property
    def same_law(self) -> tuple[Candidate, ...]:
        """The causes that are met in the name of another."""
        return candidates_of_same_law(e for each in self.effects.values() for e in each)

    def candidate(self, family: int, name: str) -> Candidate:
        """Return a family as who takes part in a comparison, under a name."""
        record = self.posterior.record
        own = record.effects.family_positions[family].tolist()
        return Candidate(name, tuple(record.model.parameters[k] for k in own))

    def places(self, name: str, parameters: frozenset[str]) -> dict[str, frozenset[str]]:
        """Return the causes that a family, without its last word, stands for; empty where it has no name."""
        kind, _, place = name.partition(", ")
        cause = GEAR_CAUSES.get(kind, kind)
        if place:
            return {f"{cause}, {place}": parameters} if cause in effect_kinds() else {}
        out = dict[str, frozenset[str]]()
        for effect in self.effects.get(cause, ()):
            # of a band every value of the inner number has a parameter of its own: NAME, VALUE
            made = tuple(p.name for p in effect.make(effect.grid[0]))
            own = frozenset(n for n in parameters if n in made or n.rpartition(", ")[0] in made)
            out[effect.family] = out.get(effect.family, frozenset()) | own
        return {cause: own for cause, own in out.items() if own}

    def rivals(self, name: str) -> Iterator[tuple[Candidate, tuple[str, ...]]]:
        """Yield who at the same joint or link and its neighbours, or all over the arm, may stand for one; its causes.

        Who acts at many places goes by its kind.

        Waves of a gear are held against those of the same gear alone: a band of them fits a little of anything.
        """
        kind, _, place = name.partition(", ")
        near = {n + step for n in _numbers(place) for step in (-1, 0, 1)}
        for f, full in enumerate(self.posterior.record.names):
            other = full.removesuffix(OF_BACKGROUND)
            if other in (full, name):
                continue
            is_gear = other.startswith(OF_GEARS)
            if is_gear and not (kind.startswith(OF_GEARS) and other.partition(", ")[2] == place):
                continue
            one = self.candidate(f, other)
            causes = self.places(other, frozenset(p.name for p in one.parameters))
            there = _numbers(other.partition(", ")[2])
            if causes and (not there or not near or there & near):
                yield Candidate(next(iter(causes)) if len(causes) == 1 else other, one.parameters), tuple(causes)


def posterior_families(posterior: PosteriorFit, findings: Sequence[Finding]) -> tuple[PosteriorFamily, ...]:
    """Return the causes of the background that are likelier to act than not.

    The bands in which the background has a gear that was found by name are that finding.
    """
    background = _Background(posterior)
    sure = [f for f in findings if not f.is_doubtful]
    gears, named = {f.on for f in sure if f.effect.startswith(OF_GEARS)}, {f.name for f in sure}
    likely = {f.name for f in posterior.families if f.probability >= STANDING_PROBABILITY}
    out = []
    for k, full in enumerate(posterior.record.names):
        name = full.removesuffix(OF_BACKGROUND)
        if name == full or full not in likely or (name.startswith(OF_GEARS) and name.partition(", ")[2] in gears):
            continue
        own = background.candidate(k, full)
        places = background.places(name, frozenset(p.name for p in own.parameters))
        if places and not named & places.keys():
            rivals = list(background.rivals(name))
            comparison = CauseComparison(own, tuple(who for who, _ in rivals), background.same_law)
            out.append(PosteriorFamily(full, places, comparison, {who.name: c for who, c in rivals if len(c) > 1}))
    return tuple(out)


def posterior_findings(released: ReleasedRobot, family: PosteriorFamily, standing: Inclusion) -> Iterator[Finding]:
    """Yield what a family is told as, with its standing in the comparison: a finding at each place where it is seen.

    Of a kind that acts somewhere, no place is named where none is seen: the largest of many small sizes is chance.
    """
    # in the comparison one cause alone stands in its place: where several together do, the draws tell
    held = next(f.probability for f in released.posterior.families if f.name == family.name)
    probability = min(standing.probability, held)
    if grade_of(probability) == "doubtful":
        return
    sizes = [s for cause, own in family.places.items() if (s := _PosteriorSize.of(released, cause, own)) is not None]
    for size in sizes:
        own = probability * (1 - size.chance(len(family.places)))
        if grade_of(own) == "doubtful":
            continue
        kind, _, place = size.cause.partition(", ")
        text = format_value(abs(size.value), size.std, *display_unit(size.unit, size.value))
        yield Finding(
            effect=kind,
            on=place,
            value=size.value,
            std=size.std,
            unit=size.unit,
            p_value=None,
            gain=size.gain,
            probability=own,
            rivals=tuple(family.rival_at(r.name, place) for r in standing.rivals),
            rival_probabilities=tuple(r.probability for r in standing.rivals),
            note=f"{size.cause}: {text}",
            beside_stages=True,
        )


@dataclass(frozen=True)
class _PosteriorSize:
    """Size of a cause of the background where it acts.

    Attributes:
        cause: its name in the catalogue.
        value, std, unit: length of its parameters' vector, of a single one with its sign, and, its shape held, how well
            that is known.
        freedom: number of its parameters.
        gain: growth of the rms error on held-out samples [m] without it, all else fitted anew.
    """

    cause: str
    value: float
    std: float
    unit: str
    freedom: int
    gain: float

    def chance(self, places: int) -> float:
        """Return how likely a size as clearly seen is chance at one of so many places; 0 of a family of one place."""
        if places == 1:
            return 0.0
        square = (self.value / max(self.std, 1e-300)) ** 2
        return float(min(1.0, places * chdtrc(self.freedom, square)))

    @classmethod
    def of(cls, released: ReleasedRobot, cause: str, parameters: frozenset[str]) -> "_PosteriorSize | None":
        """Look at the draws in which it acts; ``None`` where there are none."""
        posterior = released.posterior
        model = posterior.fit.model
        at = np.array([k for k, p in enumerate(model.parameters) if p.name in parameters], dtype=int)
        drawn = posterior.drawn[at]
        drawn = drawn[:, drawn.any(axis=0)]
        mean = drawn.mean(axis=1) if drawn.size else np.zeros(0)
        value = float(np.linalg.norm(mean))
        if value == 0.0:
            return None
        std = float((mean / value @ drawn).std())
        unit = model.parameters[int(at[0])].unit
        return cls(cause, value if len(at) > 1 else float(mean[0]), std, unit, len(at), _gain(released, at))


def _gain(released: ReleasedRobot, at: np.ndarray) -> float:
    """Return by how much the rms error would grow [m] without parameters, all else fitted anew.

    The weighted sum of squares would grow by mᵀ C⁻¹ m, with m their mean and C its covariance.
    """
    fit, gram = released.posterior.fit, released.posterior.gram
    root: Array = fit.solution.root(fit.problem.prior)[at]
    mean = fit.errors[at]
    growth = float(mean @ np.linalg.lstsq(root @ root.T, mean, rcond=None)[0])
    return released.held_out.rms * (float(np.sqrt(1 + growth / max(float(gram[-1, -1]), 1e-300))) - 1)


def _numbers(place: str) -> set[int]:
    return {int(word) for word in place.split() if word.isdigit()}
