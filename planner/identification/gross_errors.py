"""Whether what a run shows is beyond all that such robots have, and what explains it better: scale, robot or unit.

The fit learns how large the errors of a kind are, and a size that may grow fifty-fold makes everything plausible. Here
the geometry is held against what was *declared* of the robot, before any size is learnt. About the fit the whitened
readings are linear in what is unknown,

    y = X p + c s + e,    e ~ N(0, 1),    p_j ~ N(0, (k σ_j)²),

with the errors p of the geometry, their declared sigmas σ, and s, by which all readings of the gauge are too long.
Where the gauge stands, and where it reads on the tool, counts as unknown.

- **Beyond** is a parameter that is still many σ from nominal in the smallest geometry that explains the readings
  (k = 1, s = 0).
- **One factor** on all lengths, s, is no error of single links. It is sought with the size k of the lengths, and that
  of the angles, at the value that is likeliest *with* s in the model. Links that err by themselves err along s by about
  k σ / √Σ l² over their lengths l: an s of many such sigmas is a scale or a unit.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.units import DEG, MM, Array
from planner.effects.catalogue import Excitation
from planner.effects.effect import Parameter
from planner.effects.gauge_unknowns import unknowns_of
from planner.identification.assumptions import GROSS, PRIOR_FACTORS, UNKNOWN_PRIOR
from planner.identification.better_explanations import explain_better
from planner.identification.least_squares import Fit
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
        factor: by which all lengths are too long, and its standard deviation; zero where the gauge has no lengths.
    """

    parameters: tuple[Parameter, ...]
    sigma: Array
    smallest: Array
    rest: Array
    factor: float = 0.0
    factor_std: float = np.inf

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
        linear = wide.linearize(slice(0, len(few)), np.append(found.errors, np.zeros(len(scale))))
        # neighbours along a drive err alike: together they count as the fewer that they are worth
        worth = np.sqrt(min(1.0, len(problem) / max(time, 1.0) / len(few)) * few.weight)[:, None]
        rows, left = (
            (few.whitener.white(slice(None), v) * worth[..., None]).reshape(-1, v.shape[-1])
            for v in (linear.rows, linear.residual[..., None])
        )
        y = left[:, 0] + rows[:, : len(names)] @ found.errors
        columns = rows[:, at] * sigma
        R = np.asarray(np.linalg.qr(np.column_stack([columns, rows[:, len(names) :].sum(axis=1), y]), mode="r"))
        smallest = _solve(R[:, [*range(len(at)), -1]], np.ones(len(at)))[0]
        geometry = tuple(p for p, g in zip(kept, own, strict=True) if g)
        if not scale:
            return cls(geometry, sigma[own], (sigma * smallest)[own], (sigma * smallest)[own])
        rest, factor, std = _with_factor(R, lengths, angles)
        return cls(geometry, sigma[own], (sigma * smallest)[own], (sigma * rest)[own], factor, std)

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

    def has_factor(self, known: float) -> bool:
        """Tell whether all lengths share a factor that links do not have, nor a gauge of a scale ``known`` so well."""
        sure = abs(self.factor) > GROSS.factor_sigmas * np.hypot(self.factor_std, known)
        return bool(sure and abs(self.factor) > GROSS.least_factor)

    @property
    def factor_text(self) -> str:
        """The factor in per cent, to the decimals that its standard deviation allows."""
        decimals = int(np.clip(np.round(-np.log10(max(100 * self.factor_std, 1e-9))), 1, 3))
        return f"{100 * abs(self.factor):.{decimals}f} %"


def scale_parameters(found: Fit) -> tuple[Parameter, ...]:
    """Return what makes every length that the gauge reads too long; none of a gauge that reads no lengths."""
    seen = Excitation.of(found.setup, found.problem.samples)
    errors = [e for e in unknowns_of(found.setup.gauge).errors(seen) if e.kind == SCALE]
    return tuple(p for e in errors for p in e.make(None))


def _solve(R: Array, size: Array) -> tuple[Array, Array]:
    """Return the mean in sigmas, (P,), and the covariance per ``size``, (P, P), of a triangle (P + 1, P + 1)."""
    columns = R[:, :-1] * size
    information = columns.T @ columns + np.eye(len(size))
    covariance = np.asarray(np.linalg.inv(information))
    return np.asarray(size * (covariance @ (columns.T @ R[:, -1]))), covariance


def _with_factor(R: Array, lengths: np.ndarray, angles: np.ndarray) -> tuple[Array, float, float]:
    """Return errors in sigmas (P,), the factor and its standard deviation, with the sizes of the errors as learnt.

    Args:
        R: triangle of the columns per sigma, behind them that of the factor and the readings, (P + 2, P + 2).
        lengths: which columns are of lengths, (P,).
        angles: the same of angles, (P,).
    """
    rounds = 30  # of a fixed point that a few are enough for
    size = np.ones(len(lengths))
    for _ in range(rounds):
        mean, covariance = _solve(R, np.append(size, UNKNOWN_PRIOR))
        for which in (lengths, angles):
            decided = float((1 - np.diag(covariance)[:-1][which]).sum())
            square = (float((mean[:-1][which] ** 2).sum()) + 1.0) / (decided + 1.0)
            size = np.where(which, np.clip(np.sqrt(square), *PRIOR_FACTORS), size)
    return mean[:-1], float(mean[-1]), float(np.sqrt(covariance[-1, -1]))


def gross_error(found: Fit, declared: Mapping[str, float], cell: Cell, run: Run, time: float = 1.0) -> str:
    """Return why what was fitted is no calibration of this robot; empty where it may be one.

    Args:
        found: last stage.
        declared: sigma of every parameter, by name, before any was learnt [m, rad].
        cell: of the run.
        run: that was fitted.
        time: how many of its samples are worth one.
    """
    geometry = DeclaredGeometry.of(found, declared, time)
    if geometry.has_factor(found.setup.gauge.scale_sigma) and not list(geometry.beyond(geometry.rest)):
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
