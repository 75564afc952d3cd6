"""Covariance of the fitted parameters, and the tool error over the workspace that follows from it."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.common.summary import Aside
from planner.common.units import MM, Array
from planner.effects.effect import Parameter
from planner.fit.assumptions import MUCH_WORSE_RATIO, POSITION_AXES
from planner.fit.fading_noise import FadingNoise
from planner.fit.least_squares import Fit
from planner.model.identification_document import Metrics
from planner.model.tool_error import WORKSPACE_STATES, ToolError, moves_robot, samples_like, uniform_states
from planner.runs.run import Run


def parameter_covariance(fit: Fit, continuous: bool) -> tuple[Array, float]:
    """Return the covariance of the parameters (P, P) and the correlation time in samples.

    For poses at rest it is the information's inverse, noise as estimated. Along a continuous run errors stay what they
    are from sample to sample: the scatter of the scores over blocks, each many correlation times long, replaces that
    of single samples (Liang and Zeger 1986). Where the run is too short for that, that of noise which fades
    from sample to sample takes its place (``fading_noise``).
    """
    problem, solution = fit.problem, fit.solution
    root = solution.root(problem.prior)
    plain = root @ root.T
    if not continuous:
        return plain, 1.0
    noise = FadingNoise.of(fit)
    # 10: correlation times in one block of a continuous run
    size = max(1, int(np.ceil(10 * correlation_time(problem.weighted_residual(fit.errors)[:, 0]))))
    count = len(problem) // size
    if count < 3 * len(fit.errors):  # blocks for each parameter that it takes to trust their scatter
        return noise.covariance * np.outer(problem.prior, problem.prior), noise.time
    scores = _scores(fit, np.minimum(np.arange(len(problem)) // size, count - 1))
    bread = solution.inverse
    inverse = bread @ bread.T  # of the information, in prior sigmas
    half = inverse @ scores.T
    white_noise = half @ half.T * count / max(1.0, count - fit.effective)
    return np.asarray((white_noise + inverse @ inverse) * np.outer(problem.prior, problem.prior)), noise.time


def correlation_time(x: Array) -> float:
    """Return the integrated autocorrelation time in samples, 1 + 2 Σ ρ_k within Sokal's window."""
    longest_lag = 20_000  # samples over which the correlation is looked for
    x = x[: longest_lag * 5] - x.mean()
    n = len(x)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(x, size)) ** 2
    rho = np.fft.irfft(power)[: min(n, longest_lag)]
    rho /= max(rho[0], 1e-300)
    total = 1 + 2 * np.cumsum(rho[1:])
    wide = np.flatnonzero(np.arange(1, len(rho)) >= 5 * np.maximum(total, 1.0))
    return float(max(1.0, total[wide[0]] if len(wide) else total[-1]))


def _scores(fit: Fit, block: np.ndarray) -> Array:
    """Sum of rowᵀ·residual over every block, (blocks, P), in prior sigmas; ``block`` (n,) goes up with the samples."""
    columns = fit.problem.white_columns(fit.errors).columns
    each = np.einsum("prn,rn->pn", columns[:-1], columns[-1])
    return np.asarray(np.add.reduceat(each, np.flatnonzero(np.diff(block, prepend=-1)), axis=1).T)


def consider_covariance(fit: Fit, held: Sequence[Parameter]) -> Array:
    """Return the addition to the covariance (P, P) of the others if each held parameter is off by its prior sigma."""
    count = len(fit.errors)
    if not held or not count:
        return np.zeros((count, count))
    wider = fit.problem.with_model(fit.model.plus(list(held)))
    errors = np.append(fit.errors, np.zeros(len(held)))
    gram = wider.white_columns(errors).gram
    information = fit.solution.factor.T @ fit.solution.factor  # in prior sigmas, the prior's own with it
    moved = fit.problem.prior[:, None] * np.linalg.solve(information, gram[:count, count:-1])
    return np.asarray(moved @ moved.T)


def workspace_error(cell: Cell, run: Run, found: Fit, covariance: Array) -> float:
    """Return the rms error of the tool [m] over the workspace that follows from the covariance.

    A new alignment of the base is left out. States are uniform over joint space; time, loads, temperature and
    directions in them are those of samples of the run, drawn at random.

    Args:
        cell, run, found: what was fitted to what.
        covariance: of the parameters, (P, P).
    """
    model = found.model
    effects = [p for p in model.parameters if p.is_effect and moves_robot(p, model.setup)]
    samples = samples_like(run, uniform_states(cell, WORKSPACE_STATES, 0))
    return ToolError.at(samples, model.setup, effects).rms(model.names, covariance)


def workspace_warning(known: float, held_out: Metrics, width: int) -> list[str]:
    """Return a warning if the error expected over the workspace is far larger than the held-out error.

    Args:
        known: error of the tool that is to be expected over the workspace [m].
        held_out: errors of the last stage on held-out samples.
        width: numbers in one reading.
    """
    there = held_out.rms * np.sqrt(POSITION_AXES / min(width, POSITION_AXES))  # a bar reads one of three axes
    if known <= MUCH_WORSE_RATIO * there:
        return []
    return [
        Aside(
            "held-out samples are like those measured; over the workspace the tool is known to "
            f"{known / MM:.3f} mm (rms): measure more poses all over it, with a bar those of edbb plan --aim tracing"
        )
    ]
