"""How surely a finding is what it is called: its probability among all causes that explain the same, and these.

The draws of the posterior say what acts beside a finding. Any other cause may take its place: one of the catalogue that
the search looked at, at its best inner number, or one without a name, which acts where and by what those of the
catalogue do but by a law that it lacks. The other one joins what was drawn, and whatever is needless beside it goes:
one harmonic of a dented bearing after the other, none of which was worth its place alone. How likely that is, is the
ratio of both states' probabilities (a step of the Gibbs sampler over all that may stand in one place, averaged instead
of drawn: Gelfand and Smith 1990, J. Am. Stat. Assoc. 85(410)).

Other rivals of the catalogue follow from the poses alone. With columns F of the finding and G of the other in units of
what is not known beside them, the readings tell of a finding b as far as δ = min over g of |F b − G g|, g of a
plausible size: the logarithms of their likelihoods differ by δ²/2, give or take δ (Cox 1961, Proc. 4th Berkeley Symp.).
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.inference.candidates import HUNDRED_TO_ONE, CauseComparison, Inclusion, Rival
from planner.inference.comparison_columns import Block, ComparisonColumns
from planner.inference.joint_inclusion import JointInclusion, Part, sizes_of
from planner.inference.posterior_draws import SizeDraw
from planner.inference.posterior_fit import PosteriorFit

LOOKED_AT = 9  # draws, evenly spread: of three, what a UR5's middling finding is worth scattered from 0.05 to 0.93
NEAREST = 8  # causes that are tried in full for a finding, of those with a name and of those without
DECIDES = 4.6  # difference of log likelihoods that decides: a hundred to one
POWER = 1.645  # standard deviations: it must decide 95 times of 100
TOLD_APART = POWER + float(np.sqrt(POWER**2 + 2 * DECIDES))  # δ from which on the poses tell two causes apart
PLAUSIBLE = 3.0  # prior sigmas of a rival

OWN_NAME, NOTHING = "", "nothing"


def judge_findings(posterior: PosteriorFit, comparisons: Sequence[CauseComparison], worth: float) -> list[Inclusion]:
    """Return how each finding stands against its rivals; ``worth``: readings of the run per reading of the record."""
    if not comparisons:
        return []
    draws = posterior.record.draws
    looked = [draws[k] for k in even_positions(len(draws), min(LOOKED_AT, len(draws)))]
    compared = ComparisonColumns.of(posterior, comparisons, max(worth, 1.0), looked)
    weights = [
        DrawComparison.of(compared, draw).weigh_all() for draw in looked
    ]  # products of all columns: one draw's at a time
    return [average_standing(each) for each in zip(*weights, strict=True)]


@dataclass(frozen=True)
class Weights:
    """What may stand for a finding, by one draw.

    Attributes:
        logs: logarithm of the weight of each cause, 0 of the finding itself.
        by_poses: causes that readings at these poses are not expected to tell from the finding.
    """

    logs: Mapping[str, float]
    by_poses: frozenset[str] = frozenset()


def average_standing(each: Sequence[Weights]) -> Inclusion:
    """Average the probabilities of a finding over the draws."""
    probability = dict.fromkeys((name for w in each for name in (*w.logs, *sorted(w.by_poses))), 0.0)
    for weights in each:
        logs = np.array(list(weights.logs.values()))
        chance = np.exp(logs - logs.max())
        for name, p in zip(weights.logs, chance / chance.sum() / len(each), strict=True):
            probability[name] += float(p)
    alike = Counter(name for w in each for name in w.by_poses)
    by_poses = {name for name, times in alike.items() if 3 * times >= len(each)}  # in a third of the draws
    rivals = [
        Rival(name, p)
        for name, p in probability.items()
        if name not in (OWN_NAME, NOTHING) and (p >= HUNDRED_TO_ONE or name in by_poses)
    ]
    return Inclusion(probability[OWN_NAME], tuple(sorted(rivals, key=lambda r: -r.probability)))


@dataclass(frozen=True)
class ConditionalProducts:
    """What acts beside a cause, as it is taken out of products of columns.

    Attributes:
        shared: L⁻¹ Aᵀ X with L Lᵀ = 1 + AᵀA, (k, p + 1); 0 of columns that are not asked for.
        gram: products of all columns, (p + 1, p + 1).
        back: what causes among A that are taken out again give back, (r, p + 1).
    """

    shared: Array
    gram: Array
    back: Array

    @classmethod
    def of(cls, gram: Array, parts: Sequence[Part], wanted: np.ndarray | None = None) -> "ConditionalProducts":
        """Take the causes ``parts``, of known sizes, out of the products ``gram`` (p + 1, p + 1) of all columns.

        Of these some are ``wanted`` (w,) int, or all.
        """
        none = np.zeros((0, len(gram)))
        if not parts:
            return cls(none, gram, none)
        columns, size = sizes_of(parts)
        wanted = np.arange(len(gram)) if wanted is None else wanted
        root = np.linalg.cholesky(np.eye(len(columns)) + size[:, None] * gram[np.ix_(columns, columns)] * size)
        shared = np.zeros((len(columns), len(gram)))
        shared[:, wanted] = solve_triangular(root, size[:, None] * gram[np.ix_(columns, wanted)], lower=True)
        return cls(shared, gram, none)

    def without(self, fit: JointInclusion, gone: Sequence[int]) -> "ConditionalProducts":
        """Return the same without some of the causes, by their fit together.

        With Σ the covariance of all parameters over their sizes S, and o of what goes, XᵀC⁻¹X grows by
        BᵀB with B = root(Σₒₒ)⁻¹ Σₒ Sᵀ AᵀX: nothing of it is a difference.
        """
        if not gone:
            return self
        columns, size = sizes_of(fit.parts)
        at = np.concatenate([np.arange(fit.places[k].start, fit.places[k].stop) for k in gone])
        root = np.linalg.cholesky(fit.covariance[np.ix_(at, at)])
        rows = solve_triangular(root, fit.covariance[at, 1:] * size, lower=True) @ self.gram[columns]
        return replace(self, back=np.concatenate([self.back, rows]))

    def products(self, a: np.ndarray, b: np.ndarray) -> Array:
        """Return products of columns a with columns b."""
        told = self.gram[np.ix_(a, b)] - self.shared[:, a].T @ self.shared[:, b]
        return np.asarray(told + self.back[:, a].T @ self.back[:, b])

    def gains(self, block: Block) -> Array:
        """Return the growth (v,) of the log probability with each of a cause's factors."""
        y = np.array([len(self.gram) - 1])
        values, axes = np.linalg.eigh(self.products(block.columns, block.columns))
        toward = axes.T @ self.products(block.columns, y)[:, 0]
        variance = block.factors[:, None] ** 2
        grown = 1 + variance * np.maximum(values, 0.0)
        return np.asarray(0.5 * (variance * toward**2 / grown - np.log(grown)).sum(axis=1) + block.logs)

    def distance_squares(self, own: Block, b: Array, blocks: Sequence[Block]) -> Array:
        """Return δ² of the module's text, (n,), for values b (k,) of a cause, in prior sigmas, and plausible others."""
        turned = self.shared[:, own.columns] @ b
        toward = self.gram[:, own.columns] @ b - self.shared.T @ turned + self.back.T @ (self.back[:, own.columns] @ b)
        out, whole = np.empty(len(blocks)), float(b @ toward[own.columns])
        width = np.array([len(block.columns) for block in blocks])
        for k in np.unique(width).tolist():
            mine = np.flatnonzero(width == k)
            at = np.stack([blocks[n].columns for n in mine.tolist()])
            (shared, back), along = (x[:, at].transpose(1, 0, 2) for x in (self.shared, self.back)), toward[at]
            information = self.gram[at[:, :, None], at[:, None]] - shared.transpose(0, 2, 1) @ shared
            information += back.transpose(0, 2, 1) @ back + np.eye(k) / PLAUSIBLE**2
            out[mine] = whole - (along * np.linalg.solve(information, along[..., None])[..., 0]).sum(axis=1)
        return np.maximum(out, 0.0)


@dataclass(frozen=True)
class DrawComparison:
    """One draw: products of all columns beside what acts always, and what acts as drawn."""

    compared: ComparisonColumns
    gram: Array
    present: tuple[Part, ...]

    @classmethod
    def of(cls, compared: ComparisonColumns, draw: SizeDraw) -> "DrawComparison":
        """Prepare the comparisons of one draw."""
        acting = [(b, float(draw.factors[f])) for f, b in compared.families.items() if draw.factors[f] > 0]
        return cls(compared, compared.products(draw), tuple(acting))

    def weigh_all(self) -> list[Weights]:
        """Weigh all that may stand for each finding."""
        return [self.weigh(k) for k in range(len(self.compared.own))]

    def weigh(self, k: int) -> Weights:
        """Weigh all that may stand for finding k."""
        state = self._fit_around(self.compared.own[k])
        (own, size), held, whole = state.parts[-1], list(state.parts[:-1]), state.log_odds
        beside = self._without(held)
        by_poses = set[str]()
        out = {OWN_NAME: 0.0, NOTHING: -float(state.conditional_log_odds()[-1])}
        b, stand = _mean_of(beside, own, size), [(OWN_NAME, own)]
        # of the finding's share in the readings a rival must explain the larger part
        most = min(TOLD_APART**2, 0.5 * float(b @ beside.products(own.columns, own.columns) @ b))
        unnamed = {id(u) for u in self.compared.unnamed}
        others = list(self._by_distance(k, own, held, beside, b))
        without = (beside, *self._without_kin(own, held, [block for block, _, is_tried in others if is_tried]))
        logs = self._log_odds_with_each(state, own, [block for block, _, is_tried in others if is_tried], without)
        for block, left, _ in others:
            # a law of any shape holds the finding's own law too: of that only the readings tell
            if id(block) not in unnamed and left < most:
                by_poses.add(block.name)
            log = logs.get(id(block), -np.inf)
            if log > -np.inf:  # one name may have several laws
                out[block.name] = float(np.logaddexp(out.get(block.name, -np.inf), log - whole))
                stand.append((block.name, block))
        self._share_names(out, stand)
        return Weights(out, frozenset(by_poses))

    @cached_property
    def _whole_fit(self) -> JointInclusion:
        """What acts as drawn, fitted together."""
        return JointInclusion.of(self.gram, self.present)

    @cached_property
    def _lean_fit(self) -> JointInclusion:
        """The same without what is needless."""
        return self._whole_fit.prune(free=True).settle()

    @cached_property
    def _whole_beside(self) -> ConditionalProducts:
        """What acts as drawn, beside whatever takes part in a comparison."""
        return ConditionalProducts.of(self.gram, self.present, self._contestants)

    @cached_property
    def _lean_beside(self) -> ConditionalProducts:
        """The same without what is needless."""
        return ConditionalProducts.of(self.gram, self._lean_fit.parts, self._contestants)

    @cached_property
    def _contestants(self) -> np.ndarray:
        """Positions of the columns of all that take part in a comparison, and of the readings."""
        compared = self.compared
        names = {block.name for block in compared.own}
        variants = (block for block in compared.families.values() if block.name in names)
        others = (g for group in compared.others for g in group)
        return self._columns_of([*compared.own, *variants, *others, *compared.unnamed])

    def _fit_around(self, own: Block) -> JointInclusion:
        """Return the fit of a finding, the last, and of what acts beside it.

        What is needless is out: drawn by chance alone, it would count against the finding. It has the value of its
        inner number with which it was drawn.
        """
        place = next((k for k, (b, _) in enumerate(self.present) if b.name == own.name), None)
        if place is None:
            part = own, _best_factor(self._whole_beside, own)
            alone = not self.present
            state = JointInclusion.of(self.gram, [part]) if alone else self._whole_fit.add_cause(self.gram, part)
            return state.prune().settle()
        drawn, size = self.present[place]
        part = replace(own, columns=drawn.columns), size
        # what is needless beside a finding that is not needless itself goes in one order, whichever finding it is
        lean = next((k for k, (b, _) in enumerate(self._lean_fit.parts) if b.name == own.name), None)
        state = self._whole_fit.remove_cause(place) if lean is None else self._lean_fit.remove_cause(lean)
        return state.add_cause(self.gram, part).prune().settle()

    def _share_names(self, out: dict[str, float], stand: Sequence[tuple[str, Block]]) -> None:
        """Share what stands among all causes that have its law: no reading tells them apart, but one may be usual."""
        for other in self.compared.same_law:
            odds = float(other.logs[0])
            for name, block in stand:
                if self.have_one_law(block, other):
                    shared = out[name] + odds - np.logaddexp(0.0, odds)
                    out[other.name] = float(np.logaddexp(out.get(other.name, -np.inf), shared))
                    out[name] -= float(np.logaddexp(0.0, odds))

    def have_one_law(self, a: Block, b: Block) -> bool:
        """Tell whether columns span the same, as far as this run could show of any plausible size of either."""
        g, k = a.columns, b.columns
        if not len(g) or not len(k):  # one of which geometry and gauge have taken all
            return False
        within, between, other = (self.gram[np.ix_(x, y)] for x, y in ((g, g), (g, k), (k, k)))
        # 1e-9: of the largest, below which a direction is one that the geometry has taken
        one, two = (np.linalg.pinv(m, rcond=1e-9, hermitian=True) for m in (other, within))
        left = (within - between @ one @ between.T, other - between.T @ two @ between)
        return all(float(np.linalg.eigvalsh(each)[-1]) * PLAUSIBLE**2 < 1.0 for each in left)

    def _by_distance(
        self, k: int, own: Block, held: Sequence[Part], beside: ConditionalProducts, b: Array
    ) -> Iterator[tuple[Block, float, bool]]:
        """Yield the causes that may explain what finding k does, δ² of each, and whether it is one of the nearest."""
        there = {part[0].name for part in held} | {own.name}
        for group in (self.compared.others[k], self.compared.unnamed):
            rivals = [g for g in group if g.name not in there]
            left = beside.distance_squares(own, b, rivals)
            order = np.argsort(left, kind="stable").tolist()
            yield from ((rivals[n], float(left[n]), place < NEAREST) for place, n in enumerate(order))

    def _without(self, held: Sequence[Part]) -> ConditionalProducts:
        """Return what acts beside another cause where ``held`` alone acts, of what was drawn."""
        if not held:
            return ConditionalProducts.of(self.gram, held)
        names = {block.name for block, _ in held}
        lean = names <= {block.name for block, _ in self._lean_fit.parts}
        fit, beside = (self._lean_fit, self._lean_beside) if lean else (self._whole_fit, self._whole_beside)
        return beside.without(fit, [n for n, (block, _) in enumerate(fit.parts) if block.name not in names])

    def _without_kin(self, own: Block, held: Sequence[Part], tried: Sequence[Block]) -> tuple[ConditionalProducts, ...]:
        """Return the same without a finding's kin, for causes that are tried; nothing where it has none."""
        place = own.name.removesuffix(" (background)").partition(", ")[2]
        others = [part for part in held if part[0].name.removesuffix(" (background)").partition(", ")[2] != place]
        few = len(others) < len(held) and len(tried) > 0
        return (ConditionalProducts.of(self.gram, others, self._columns_of(tried)),) if few else ()

    def _columns_of(self, blocks: Sequence[Block]) -> np.ndarray:
        """Return the positions of the columns of causes, and of the readings."""
        return np.unique(np.concatenate([*(b.columns for b in blocks), [len(self.gram) - 1]]))

    def _log_odds_with_each(
        self, state: JointInclusion, own: Block, blocks: Sequence[Block], without: Sequence[ConditionalProducts]
    ) -> dict[int, float]:
        """Return the log odds with each newcomer in and all needless out, by its id; of those where the finding goes.

        A newcomer has one of the sizes that are best beside what acts ``without`` the finding.
        """
        newcomers = [(b, s) for b in blocks for s in dict.fromkeys(_best_factor(rest, b) for rest in without)]
        out = dict[int, float]()
        for (block, _), grown in zip(newcomers, state.add_each(self.gram, newcomers), strict=True):
            kept = grown.prune()
            if not any(b is own for (b, _), stays in zip(kept.parts, kept.stays, strict=True) if stays):
                out[id(block)] = max(kept.log_odds, out.get(id(block), -np.inf))
        return out


def _best_factor(beside: ConditionalProducts, block: Block) -> float:
    return float(block.factors[int(np.argmax(beside.gains(block)))])


def _mean_of(beside: ConditionalProducts, own: Block, size: float) -> Array:
    """Return the mean of a cause's parameters, (k,) in prior sigmas."""
    y = np.array([len(beside.gram) - 1])
    information = beside.products(own.columns, own.columns) + np.eye(len(own.columns)) / size**2
    return np.asarray(np.linalg.solve(information, beside.products(own.columns, y)[:, 0]))
