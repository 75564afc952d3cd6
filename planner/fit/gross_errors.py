"""Whether what a run shows is beyond all that such robots have, and what explains it better: scale, robot or unit.

The fit learns how large the errors of a kind are, and a size that may grow fifty-fold makes everything plausible. Here
the geometry is held against what was *declared* of the robot, before any size is learnt. About the fit the whitened
readings are linear in what is unknown,

    y = X p + c s + e,    e ~ N(0, 1),    p_j ~ N(0, (k σ_j)²),

with the errors p of the geometry, their declared sigmas σ, and s, by which all readings of the gauge are too long.
Where the gauge stands, and where it reads on the tool, counts as unknown.

- **Beyond** is a parameter that is still many σ from nominal in the smallest geometry that explains the readings
  (k = 1, s = 0).
- **One factor** on all lengths, s, is no error of single links. Two models are held against each other: s as small as
  the gauge's declared scale, and s of a gauge whose scale or unit is wrong. Each is averaged over the sizes k of
  lengths and angles, which are declared to a factor of two. Links that err by themselves err along s by about
  k σ / √Σ l² over their lengths l: a smaller s is not told from them, and the statement says so.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from scipy.special import expit, logit, ndtri, softmax

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.summary import Aside
from planner.common.units import DEG, MM, Array
from planner.effects.basis import ONE, Times
from planner.effects.catalogue import Excitation
from planner.effects.effect import Parameter, ParameterMove
from planner.effects.gauge_unknowns import unknowns_of
from planner.effects.sizes import UNKNOWN_PRIOR
from planner.fit.assumptions import GROSS, LOG_NOISE_SIGMA, PRIOR_FACTORS
from planner.fit.better_explanations import explain_better
from planner.fit.least_squares import Fit
from planner.runs.run import Run

SCALE: Final = "gauge scale"  # of the catalogue


@dataclass(frozen=True)
class DeclaredGeometry:
    """What a run says of the geometry by its declared sigmas.

    Attributes:
        parameters: lengths and angles of the geometry.
        sigma: declared of each, (G,) [m, rad].
        smallest: errors that explain the readings with the least Σ (p/σ)², (G,) [m, rad].
        rest: the same with one factor on all lengths, (G,) [m, rad]; as ``smallest`` where the gauge has no lengths.
        factor: by which all lengths are too long, if they share one, and its standard deviation; zero where the gauge
            has no lengths.
        factor_probability: that they share one.
    """

    parameters: tuple[Parameter, ...]
    sigma: Array
    smallest: Array
    rest: Array
    factor: float = 0.0
    factor_std: float = np.inf
    factor_probability: float = 0.0

    @classmethod
    def of(cls, found: Fit, declared: Mapping[str, float], time: float = 1.0) -> "DeclaredGeometry":
        """Linearise about a fit; ``declared``: sigmas by name [m, rad]; ``time``: how many samples are worth one."""
        most = 6000  # readings of a run that are looked at
        problem, names = found.problem, found.model.names
        few = problem.take(even_positions(len(problem), most // found.model.width))
        at = [k for k, p in enumerate(found.model.parameters) if p.group != SCALE]
        kept = [found.model.parameters[k] for k in at]
        lengths, angles = (
            np.array([p.group == "geometry" and (p.unit == "m") is of_length for p in kept])
            for of_length in (True, False)
        )
        own = lengths | angles
        sizes = (p.prior if p.is_effect else declared[p.name] if g else np.inf for p, g in zip(kept, own, strict=True))
        sigma = np.nan_to_num(np.array(list(sizes)), posinf=UNKNOWN_PRIOR)
        scale = scale_parameters(found)
        wide = few.with_model(found.model.plus(list(scale)))
        linear = wide.linearize(np.append(found.errors, np.zeros(len(scale))))
        # neighbours along a drive err alike: together they count as the fewer that they are worth
        worth = np.sqrt(min(1.0, len(problem) / max(time, 1.0) / len(few)) * few.weight)[:, None]
        rows, left = (
            (few.whitener.white(v) * worth[..., None]).reshape(-1, v.shape[-1])
            for v in (linear.rows, linear.residual[..., None])
        )
        y = left[:, 0] + rows[:, : len(names)] @ found.errors
        columns = rows[:, at] * sigma
        R = np.asarray(np.linalg.qr(np.column_stack([columns, rows[:, len(names) :].sum(axis=1), y]), mode="r"))
        R = _of_geometry(R, own)
        G, geometry = int(own.sum()), tuple(p for p, g in zip(kept, own, strict=True) if g)
        smallest = sigma[own] * _solve(R[:, [*range(G), -1]], np.ones((1, G)))[0][0]
        if not scale:
            return cls(geometry, sigma[own], smallest, smallest)
        gauge = found.setup.gauge
        rest, *shared = _weigh_factor(R, lengths[own], gauge.scale_sigma, gauge.wrong_scales)
        return cls(geometry, sigma[own], smallest, sigma[own] * rest, *shared)

    @property
    def limits(self) -> Array:
        """How far from nominal each may be, (G,) [m, rad]."""
        is_length = np.array([p.unit == "m" for p in self.parameters], dtype=bool)
        most = np.where(is_length, GROSS.length_sigmas, GROSS.angle_sigmas) * self.sigma
        largest = np.where(is_length, GROSS.length, GROSS.angle)
        return np.asarray(np.minimum(most, np.maximum(largest, GROSS.never_refused_sigmas * self.sigma)))

    def beyond(self, errors: Array) -> Iterator[tuple[Parameter, float, float]]:
        """Yield parameter, error and declared sigma of those that are too far off, the farthest by its sigma first."""
        out = np.flatnonzero(np.abs(errors) > self.limits)
        for k in out[np.argsort(-np.abs(errors[out] / self.sigma[out]), kind="stable")]:
            yield self.parameters[k], float(errors[k]), float(self.sigma[k])

    @property
    def has_factor(self) -> bool:
        """Whether all lengths share a factor that links do not have, nor a gauge as good as it is declared."""
        refused = 0.3  # probability from which on: of 10 800 clean simulated arms 11 were
        return self.factor_probability > refused and abs(self.factor) > GROSS.least_factor

    @property
    def factor_at_most(self) -> float:
        """What a factor that is not ruled out stays below with a probability of 95 %."""
        if (share := 0.05 / max(self.factor_probability, 1e-300)) >= 1.0:
            return 0.0
        return max(0.0, abs(self.factor) + self.factor_std * float(ndtri(1.0 - share)))

    def draw_factors(self, count: int) -> Array:
        """Return the factor of ``count`` robots drawn: zero but for as many of them as its probability says."""
        drawn, share = np.zeros(count), round(self.factor_probability * count)
        if share:
            drawn[:share] = self.factor + self.factor_std * ndtri((np.arange(share) + 0.5) / share)
        return np.asarray(np.random.default_rng(0).permutation(drawn))

    @property
    def factor_text(self) -> str:
        """The factor in per cent, to the decimals that its standard deviation allows."""
        return self._percent(self.factor)

    def _percent(self, factor: float) -> str:
        decimals = int(np.clip(np.round(-np.log10(max(100 * self.factor_std, 1e-9))), 1, 3))
        return f"{100 * abs(factor):.{decimals}f} %"

    @property
    def factor_notes(self) -> tuple[str, ...]:
        """Say that a factor is not ruled out, or how large one would not be seen; nothing without lengths."""
        if not np.isfinite(self.factor_std):
            return ()
        if self.factor_at_most > 0.0:
            return (
                f"all lengths may be off by one factor of {self._percent(self.factor)} ± "
                f"{self._percent(self.factor_std)} ({100 * self.factor_probability:.0f} % likely): check scale and "
                "unit of the gauge; the limit of 95 % counts with it",
            )
        # 3.5: standard deviations, below which more than half of all factors are not told
        unseen = max(3.5 * self.factor_std, GROSS.least_factor)
        told = f"one factor on all lengths of up to {self._percent(unseen)} would not be seen: the run cannot tell it"
        return (Aside(f"{told} from errors of the links, and the statement rests on the scale of the gauge"),)


def scale_parameters(found: Fit) -> tuple[Parameter, ...]:
    """Return what makes every length too long; none for a gauge that reads no lengths.

    To a gauge whose readings are too long the whole arm is larger: that is linear about the fitted arm, which is as
    large, while a camera whose board is larger is not. Where a joint slides its travel would be longer too, which
    lengths of links are not, and it is the gauge that is varied.
    """
    seen = Excitation.of(found.setup, found.problem.samples)
    own = tuple(p for e in unknowns_of(found.setup.gauge).errors(seen) if e.kind == SCALE for p in e.make(None))
    if not own or found.setup.robot.slides.any():
        return own
    moves = tuple(ParameterMove("transform", k, Times(length, ONE)) for k, length in seen.lengths)
    return (Parameter("arm_size", "1", GROSS.factor_sigma, "size of the whole arm", moves, "geometry"),)


def _of_geometry(R: Array, own: np.ndarray) -> Array:
    """Return the triangle of the geometry's columns, the factor and the readings, what else is unknown averaged out.

    Args:
        R: triangle of all columns per sigma, behind them that of the factor and the readings, (P + 2, P + 2).
        own: which columns are of the geometry, (P,).
    """
    others = np.flatnonzero(~own)
    order = [*others, *np.flatnonzero(own), len(own), len(own) + 1]
    stacked = np.vstack([R[:, order], np.eye(len(others), len(order))])
    return np.asarray(np.asarray(np.linalg.qr(stacked, mode="r"))[len(others) :, len(others) :])


def _solve(R: Array, sizes: Array) -> tuple[Array, Array, Array]:
    """Return mean and standard deviation of what is unknown, (K, P) each, and the log evidence, (K,) up to a constant.

    Args:
        R: triangle of columns and readings, (P + 1, P + 1).
        sizes: standard deviations beforehand, K sets of them, (K, P).
    """
    K, P = sizes.shape
    below = np.broadcast_to(np.eye(P, P + 1), (K, P, P + 1))  # the prior's rows
    scaled = R * np.column_stack([sizes, np.ones(K)])[:, None]
    T = np.asarray(np.linalg.qr(np.concatenate([scaled, below], axis=1), mode="r"))
    inverse = np.linalg.inv(T[:, :P, :P])
    mean, std = (inverse @ T[:, :P, P:])[..., 0], np.sqrt((inverse**2).sum(axis=2))
    evidence = -0.5 * T[:, P, P] ** 2 - np.log(np.abs(np.diagonal(T[:, :P, :P], axis1=1, axis2=2))).sum(axis=1)
    return sizes * mean, sizes * std, evidence


def _weigh_factor(
    R: Array, lengths: np.ndarray, known: float, wrong_scales: float
) -> tuple[Array, float, float, float]:
    """Return errors in sigmas (G,) beside a factor, the factor, its standard deviation, and how likely there is one.

    Args:
        R: triangle of the columns of the geometry per sigma, of the factor and of the readings, (G + 2, G + 2).
        lengths: which columns are of lengths, (G,); the others are of angles.
        known: standard deviation of the gauge's scale as declared.
        wrong_scales: share of the runs with such a gauge whose scale or unit is wrong.
    """
    sizes = np.geomspace(*PRIOR_FACTORS, 16)  # a factor of 1.5 apart
    pairs = np.array(list(product(sizes, sizes)))
    prior = -0.5 * (np.log(pairs) ** 2).sum(axis=1) / LOG_NOISE_SIGMA**2
    own = np.where(lengths, pairs[:, :1], pairs[:, 1:])
    sound, wrong = (
        _solve(R, np.column_stack([own, np.full(len(own), s)])) for s in (known, np.hypot(known, GROSS.factor_sigma))
    )
    log_odds = logit(wrong_scales) + np.logaddexp.reduce(wrong[2] + prior) - np.logaddexp.reduce(sound[2] + prior)
    mean, std, evidence = wrong
    weight = softmax(evidence + prior)
    factor = float(weight @ mean[:, -1])
    spread = float(np.sqrt(weight @ (std[:, -1] ** 2 + (mean[:, -1] - factor) ** 2)))
    return weight @ mean[:, :-1], factor, spread, float(expit(log_odds))


def gross_error(geometry: DeclaredGeometry, cell: Cell, run: Run) -> str:
    """Return why what was fitted is no calibration of this robot; empty where it may be one."""
    if geometry.has_factor and not list(geometry.beyond(geometry.rest)):
        longer = "longer" if geometry.factor > 0 else "shorter"
        return (
            f"all lengths are off by one factor ({geometry.factor_text}): scale or unit. The gauge reads this arm "
            f"{longer} than its links can be. Check scale and unit of the gauge, and the distances of balls, sockets "
            "or squares in the cell"
        )
    if not (far := list(geometry.beyond(geometry.smallest))):
        return ""
    named = ", ".join(_far_text(*f) for f in far[:3])
    return f"no such robot is so far off: {named}; {explain_better(cell, run) or _cure_text([p for p, *_ in far])}"


def _far_text(p: Parameter, error: float, sigma: float) -> str:
    size = f"{abs(error) / MM:.1f} mm" if p.unit == "m" else f"{abs(error) / DEG:.2f} deg"
    return f"{p.name} ({p.what}) by {size}, {abs(error) / sigma:.0f} times what is usual"


def _cure_text(far: Sequence[Parameter]) -> str:
    """Say what to look for where neither another robot nor another unit explains what is too far off."""
    zeros = [p.what for p in far if p.what.startswith("zero of joint")]
    known = 'class = "hobby" in the cell, or [priors] in the file of the robot, say of one that is known no better'
    if len(zeros) == len(far):
        return f"was the mastering lost? Master the axis anew and measure again; {known}"
    return f"look for another robot, a wrong number in its file, another ball or fixture; {known}"
