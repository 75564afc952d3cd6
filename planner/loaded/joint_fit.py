"""One fit of kinematics and compliances to unloaded and loaded runs together (EDBB paper, section 5)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from planner.cell.cell import Cell
from planner.cell.placement import Targets
from planner.common.errors import InputError
from planner.common.units import UM, Array, read_only
from planner.effects.compliance import compliance_parameters
from planner.fit.covariance import correlation_time
from planner.fit.identifiable_parameters import estimate_parameters, identifiable_subset
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import add_motion, locate_gauge, setup_for_run
from planner.fit.wild_rows import row_weights
from planner.loaded.assumptions import JOINT_FIT
from planner.loaded.types import AveragedCurves, LoadedEvaluation
from planner.model.identification_document import Estimate
from planner.model.model import Model
from planner.runs.loader import join_runs
from planner.runs.run import Readings, Run, Samples
from planner.simulation.equilibrium import use_held_torques, with_held_torque


def averaged_run(found: LoadedEvaluation) -> Run:
    """Return averaged curves as a run of poses at rest, a sample for each of 24 angles, loads and senses."""
    rows = []
    for k, c in enumerate(x.curves for x in found.circles):
        which = _thin_angles(c)
        q, length, force = (v[:, :, which] for v in (c.q, c.length, c.force))
        n = length.size
        rows.append((q.reshape(n, -1), length.ravel(), force.ravel(), np.full(n, k)))
    q, length, force, place = (np.concatenate(column) for column in zip(*rows, strict=True))
    samples = Samples(q=read_only(q), place=place, force=read_only(force), session=np.zeros(len(q), dtype=int))
    places = tuple(c.curves.circle.name for c in found.circles)
    return Run(f"{found.name}, averaged", samples, Readings(length=read_only(length)), places, robot=found.robot)


def averages_noise(found: LoadedEvaluation) -> tuple[Array, ...]:
    """Return the covariance of the rows of :func:`averaged_run`: for each circle and sense (K, A, A) [m²].

    It is what the repeats say of turns, harmonic by harmonic, larger by as much as the loads' curves differ more.
    """
    out = []
    for c in (x.curves for x in found.circles):
        B, which = len(c.theta), _thin_angles(c)
        flat = np.full(B // 2 + 1, found.compliances.noise**2 * float(np.mean(c.repeats)))
        spectrum = c.noise if np.all(np.isfinite(c.noise)) else flat
        apart = np.fft.irfft(spectrum, B) * max(1.0, found.compliances.misfit) ** 2
        turn = apart[(which[:, None] - which) % B]
        out += [turn / c.repeats[d, :, None, None] for d in range(len(c.directions))]
    return tuple(out)


def _thin_angles(c: AveragedCurves) -> np.ndarray:
    """Angles of averaged curves that enter, (A,) int."""
    groups = np.array_split(np.arange(len(c.theta)), min(JOINT_FIT.angles_a_turn, len(c.theta)))
    return np.array([g[len(g) // 2] for g in groups])


def at_rest(run: Run) -> Run:
    """Return a run without its clock; of a continuous one so few samples that each has an error of its own.

    Neighbours along a drive share the deviation of the arm from where it reads: all of them would outweigh the turns,
    which are averages. One in ``SAMPLE_SPACING`` seconds is left, or where there is no clock one of
    ``SPARSE_STEP``.
    """
    samples = run.samples
    if not run.continuous:
        return replace(run, samples=replace(samples, t=None))
    step = JOINT_FIT.sparse_step
    if samples.t is not None and len(run) > 1:
        step = max(1, round(JOINT_FIT.sample_spacing / float(np.median(np.abs(np.diff(samples.t))))))
    which = np.arange(0, len(run), step)
    thin = replace(samples.take(which), t=None, speed=None)
    return replace(run, samples=thin, readings=run.readings.take(which), continuous=False)


@dataclass(frozen=True)
class RefinedFit:
    """Errors (P,), their covariance (P, P), and the residuals reading − prediction (n,) [m]."""

    errors: Array
    covariance: Array
    residual: Array


def refine_fit(problem: FitProblem, run: Run, errors: Array, turns: Sequence[Array]) -> RefinedFit:
    """Go on from ``errors`` (P,) until nothing changes, the torques being those in balance (Gauss and Newton).

    Rows without load that stand outside their noise count for little; turns are averages, and count in full.

    Args:
        problem: with the noise and prior sigmas as they were found, its compliances by held torques.
        run: of the problem, the rows of ``turns`` last.
        errors: where to begin.
        turns: covariance of the averages over A angles for the K loads of each block, (K, A, A) [m²], in the order of
            the run.
    """
    still_share = 1e-3  # standard deviations: a step that changes nothing
    model, prior, declared = problem.model, problem.prior, problem.whitener.covariance()[:, 0, 0]
    first = len(run) - sum(len(c) * c.shape[1] for c in turns)
    size, weight = 1.0, problem.weight[:first]
    turned = torque_rows(model, run.samples, errors, prior)  # once: they change by parts of themselves
    for _ in range(12):  # Gauss-Newton steps at most
        about = model.linearize(with_held_torque(run.samples, model, errors), problem.targets, errors)
        rows, residual = about.rows[:, 0] + turned, about.residual[:, 0]
        columns = np.column_stack([rows, residual])
        variance = size * declared
        counted = np.append(variance[:first] / weight, variance[first:])
        white = np.concatenate(list(_whiten_rows(columns, counted, first, turns)))
        covariance = _scaled_inverse(white[:, :-1].T @ white[:, :-1] + np.diag(prior**-2.0), prior)
        step = covariance @ (white[:, :-1].T @ white[:, -1] - errors / prior**2)
        errors = errors + step
        left = white[:first, -1] - white[:first, :-1] @ step
        leverage = np.einsum("ni,ij,nj->n", white[:first, :-1], covariance, white[:first, :-1])
        before, size = size, size * float((left**2).sum()) / max(1.0, float((weight - leverage).sum()))
        scaled = left / np.sqrt(weight * size / before)  # in standard deviations of the new noise
        weight = row_weights(scaled[:, None], leverage[:, None], weight)
        still = np.abs(step / np.sqrt(np.diag(covariance))).max() < still_share
        if still and abs(size / before - 1.0) < still_share:
            break
    left = model.residual(with_held_torque(run.samples, model, errors), problem.targets, errors)[:, 0]
    return RefinedFit(read_only(errors), read_only(covariance), read_only(left))


def _whiten_rows(columns: Array, variance: Array, first: int, turns: Sequence[Array]) -> Iterator[Array]:
    """Columns (n, C) in standard deviations: rows without load each by itself, then the blocks of turns."""
    yield columns[:first] / np.sqrt(variance[:first, None])
    for noise in turns:
        part = slice(first, first + len(noise) * noise.shape[1])
        yield whiten_turns(columns[part], noise, variance[part])
        first = part.stop


def whiten_turns(columns: Array, noise: Array, pose: Array) -> Array:
    """Return columns (K·A, C) of the K loads of a circle in one sense, in independent standard deviations.

    Args:
        columns: of the rows, load by load.
        noise: covariance of the averages over the A angles, for each load (K, A, A) [m²].
        pose: variance of the error that a pose has with any load, (K·A,) [m²]; it is common to the loads.
    """
    K, A = noise.shape[:2]
    common = np.diag(pose.reshape(K, A).mean(axis=0))
    block = np.kron(np.ones((K, K)), common) + block_diag(*noise)
    return np.asarray(solve_triangular(np.linalg.cholesky(block), columns, lower=True))


def torque_rows(model: Model, samples: Samples, errors: Array, prior: Array) -> Array:
    """Return the derivative of the readings by each parameter through the torques, (n, P), at ``errors``.

    The model's compliances are by held torques; ``prior`` (P,) are the sizes by which the torques are tried.
    """
    nothing = Targets(length=np.zeros(len(samples)))

    def read(torques_by: Array) -> Array:
        """Return the readings under these torques, (n,)."""
        return np.asarray(-model.residual(with_held_torque(samples, model, torques_by), nothing, errors)[:, 0])

    out, here = np.empty((len(samples), len(prior))), read(errors)
    for k, size in enumerate(0.1 * prior):  # of the prior sigma, for the derivative of the torques
        moved = errors.copy()
        moved[k] += size
        out[:, k] = (read(moved) - here) / size
    return out


def _scaled_inverse(information: Array, prior: Array) -> Array:
    scale = np.outer(prior, prior)
    return np.asarray(np.linalg.inv(information * scale) * scale)


@dataclass(frozen=True)
class JointFit:
    """One fit of both kinds of run.

    Attributes:
        run: all samples, as poses at rest.
        estimates: every parameter, seen or not.
        names, errors, covariance: of the fitted parameters, (P,), (P, P).
        rms: of the residuals without load, and with load [m].
        problems: reasons not to use the fit.
    """

    run: Run
    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    errors: Array
    covariance: Array
    rms: tuple[float, float]
    problems: tuple[str, ...] = ()


def fit_jointly(cell: Cell, unloaded: Run, loaded: Run, turns: Sequence[Array]) -> JointFit:
    """Fit geometry, gauge and compliances to an unloaded run and the averaged curves of a loaded one together.

    ``turns`` is the noise of the averages, see :func:`planner.loaded.joint_fit.averages_noise`.

    Raises:
        InputError: the runs do not belong to the cell, share a fixture, or the first is no bar's.
        NoSolutionError: the fit does not come to rest.
    """
    _check(unloaded, loaded)
    whole_run = join_runs([add_motion(run) for run in (at_rest(unloaded), loaded)])
    setup = replace(
        locate_gauge(setup_for_run(cell, whole_run), whole_run), loaded=dict.fromkeys(loaded.places, "force_N")
    )
    own = [whole_run.places.index(p) for p in loaded.places]
    whole = Model.of(setup, cell.plan.free).plus(list(use_held_torques(compliance_parameters(setup))))
    whole_run = _with_balanced_torque(whole_run, whole, np.zeros(len(whole.parameters)))
    _, seen = identifiable_subset(whole, whole_run.samples)
    gauge = [k for k, p in enumerate(whole.parameters) if p.group == "gauge"]
    model = whole.subset(sorted({*seen.kept, *gauge}))
    for _ in range(2):  # times the torques are put in balance before the last steps
        found = fit(FitProblem.of(model, whole_run))
        whole_run = _with_balanced_torque(whole_run, model, found.errors)
    last = refine_fit(found.problem, whole_run, found.errors, turns)
    found = replace(found, solution=replace(found.solution, errors=last.errors))
    dropped = tuple(d for d in seen.dropped if d.name not in model.names)
    under = np.isin(whole_run.samples.place, own)
    alike = correlation_time(last.residual[~under]) if unloaded.continuous else 1.0
    covariance = read_only(max(1.0, alike) * last.covariance)
    rms = _rms(last.residual[~under]), _rms(last.residual[under])
    return JointFit(
        replace(whole_run, samples=replace(whole_run.samples, torque=None, reversals=None, length=None)),
        estimate_parameters(whole, found, dropped, covariance),
        model.names,
        last.errors,
        covariance,
        rms,
        _disagreement(model, whole_run, under, rms),
    )


def _disagreement(model: Model, run: Run, under: np.ndarray, rms: tuple[float, float]) -> tuple[str, ...]:
    """Say where one model cannot follow both runs: one of them leaves far more than in a fit of its own."""
    for part, left, words in ((~under, rms[0], "without load"), (under, rms[1], "under load")):
        alone = fit(FitProblem.of(model, run.take(part)))
        own = _rms(alone.problem.residual(alone.errors))
        if left > JOINT_FIT.disagreement_ratio * float(np.hypot(own, model.setup.gauge.noise)):
            return (
                f"the runs without load and under load disagree: fitted together, {left / UM:.1f} µm are left {words}, "
                f"by itself that run leaves {own / UM:.1f} µm; were both measured on one robot, at the fixtures that "
                "they name?",
            )
    return ()


def _with_balanced_torque(run: Run, model: Model, errors: Array) -> Run:
    return replace(run, samples=with_held_torque(run.samples, model, errors))


def _rms(residual: Array) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _check(unloaded: Run, loaded: Run) -> None:
    if unloaded.readings.length is None:
        raise InputError(f"{unloaded.name}: the joint fit needs length_mm, a bar's run without load")
    shared = sorted(set(unloaded.places) & set(loaded.places))
    if shared:
        raise InputError(
            f"{unloaded.name}: shares the fixture '{shared[0]}' with the loaded run; two bars stand on two fixtures, "
            "each with its name in [[fixtures]] and in the column fixture"
        )
