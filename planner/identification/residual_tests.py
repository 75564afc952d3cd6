"""Tests of the whitened residual for structure along everything that was logged.

The fitted parameters are projected out of the alternatives; then one F test each, with Bonferroni's correction.
Readings of one pose count as one, and along a continuous run correlated samples count as one. Of poses at rest the
order of measuring is tested too (Ljung and Box 1978). Far outliers are clipped (a score test by Huber's psi)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, fdtrc

from planner.common.determinism import even_positions
from planner.common.robust import MEDIAN_NORM
from planner.common.units import Array, read_only
from planner.documents.calibration import ResidualDiagnosis, ResidualTest
from planner.fit.assumptions import CLIPPED_SIGMAS, LARGE_NOISE_RATIO, SIGNIFICANCE
from planner.fit.covariance import correlation_time
from planner.fit.cross_validation import number_targets
from planner.fit.least_squares import Fit, subset_size
from planner.fit.problem import FitProblem, ProblemCache
from planner.fit.residual_alternatives import alternative_columns, joint_columns
from planner.model.row_basis import space_basis

FEWEST_DOF = 10.0  # degrees of freedom of the correlation time, below which nothing is said
MEASURING_ORDER = "order of measuring"
TOO_FEW = "There are too few readings beyond the parameters to tell what is left from chance."
NO_DIAGNOSIS = ResidualDiagnosis((), (), 0.0, TOO_FEW)


@dataclass(frozen=True)
class ProjectedResidual:
    """Whitened residual with the model's columns projected out; readings of one group count as one.

    Attributes:
        white: (m,), of the groups in the order of measuring, r numbers each.
        basis: orthonormal, of the model's columns, (m, P).
        group: of every sample, (n,) int.
        width: numbers of a reading, r.
    """

    white: Array
    basis: Array
    group: np.ndarray
    width: int

    @classmethod
    def of(cls, problem: FitProblem, errors: Array, moving: bool) -> "ProjectedResidual":
        """Look at what a fit leaves; along a continuous run every sample is its own group."""
        group = np.arange(len(problem)) if moving else number_targets(problem.samples)
        # the columns themselves are let go before they are brought into another form: of many they take most memory
        basis = space_basis(group_sums(without_noise(problem, errors).white_columns(errors).rows, group))
        white = group_sums(problem.weighted_residual(errors)[..., None], group)[:, 0]
        return cls(white - basis @ (basis.T @ white), basis, group, problem.model.width)

    @property
    def dof(self) -> float:
        """Degrees of freedom that the model leaves."""
        return float(len(self.white) - self.basis.shape[1])

    @cached_property
    def square(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.white @ self.white)

    def clip_outliers(self) -> "ProjectedResidual":
        """Clip numbers beyond 2.5 robust standard deviations, and project the model out anew."""
        far = CLIPPED_SIGMAS * float(np.median(np.abs(self.white))) / MEDIAN_NORM[1]
        white = np.clip(self.white, -far, far)
        return replace(self, white=white - self.basis @ (self.basis.T @ white))

    def bases_beyond(self, problem: FitProblem, alternatives: Iterable[tuple[str, Array]]) -> dict[str, Array]:
        """Orthonormal bases (m, rank) of what each of some columns (n, r, k) of the reading reach beyond the model.

        By the names that these have.
        """
        named = dict(alternatives)
        if not named:
            return {}
        white = problem.whitener.white(np.concatenate(list(named.values()), axis=2))
        tall = group_sums(white * np.sqrt(problem.weight)[:, None, None], self.group)
        tall /= np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
        tall -= self.basis @ (self.basis.T @ tall)
        # 0.1: of a column, below which rounding has put back what is to be told of it, and once more takes that
        few = np.linalg.norm(tall, axis=0) < 0.1
        tall[:, few] -= self.basis @ (self.basis.T @ tall[:, few])
        ends = np.cumsum([columns.shape[2] for columns in named.values()])
        return {
            name: orthonormal_basis(own) for name, own in zip(named, np.split(tall, ends[:-1], axis=1), strict=True)
        }


def orthonormal_basis(tall: Array) -> Array:
    """Orthonormal basis (m, rank) of columns (m, k) of unit length, without those shorter than a thousandth."""
    size, axes = np.linalg.eigh(tall.T @ tall)
    shown = size > 1e-3**2  # part of a column that must be left beyond the model for it to count
    return np.asarray(tall @ (axes[:, shown] / np.sqrt(size[shown])))


def group_sums(rows: Array, group: np.ndarray) -> Array:
    """Sum the rows (m, r, k) of each group over the root of its size, so that noise keeps its size; (groups·r, k)."""
    count = np.bincount(group)
    if len(count) == len(group):
        return rows[np.argsort(group)].reshape(-1, rows.shape[2])
    out = np.zeros((len(count), *rows.shape[1:]))
    np.add.at(out, group, rows)
    return np.asarray(out / np.sqrt(count)[:, None, None]).reshape(-1, rows.shape[2])


@dataclass(frozen=True)
class NoiseCorrelation:
    """Autocorrelation of the noise: so many samples count as one, known with so many degrees of freedom."""

    time: float = 1.0
    dof: float = np.inf


def noise_correlation(rest: ProjectedResidual, explained: Array) -> NoiseCorrelation:
    """Estimate the autocorrelation of what the columns ``explained`` (m, k), orthonormal, beyond the model, leave.

    Model and alternatives change slowly along the drive: with them a part of the slow noise is projected out, from
    which the time is read. Over the window of that reading (Sokal's, 5 times either way) it is trace(BᵀTB)/n, B the
    basis of all that was projected out, T one within the window. The time scatters as a sum of 10·time correlations.
    """
    left = (rest.white - explained @ (explained.T @ rest.white)).reshape(-1, rest.width)
    time = max(correlation_time(component) for component in left.T)
    window = int(np.ceil(5 * time))
    absorbed = (
        _neighbours_product(rest.basis, rest.width, window) + _neighbours_product(explained, rest.width, window)
    ) / left.size
    if absorbed > 0.8:  # of the slow noise may be projected out before its autocorrelation is no longer known
        return NoiseCorrelation(np.inf, 0.0)
    time /= 1 - absorbed
    return NoiseCorrelation(time, len(left) / (10 * time + 1))


def _neighbours_product(basis: Array, width: int, window: int) -> float:
    """Sum over all pairs of samples within a window of the products of their rows in a basis (n · width, k)."""
    several = 16  # basis vectors whose running sums stay in the processor's cache
    out = 0.0
    for first in range(0, basis.shape[1], several):
        own = basis[:, first : first + several]
        own = own.reshape(len(basis) // width, -1)
        total = np.cumsum(np.pad(own, ((window + 1, window), (0, 0))), axis=0)
        out += float((own * (total[2 * window + 1 :] - total[: -2 * window - 1])).sum())
    return out


@dataclass(frozen=True)
class ResidualBattery:
    """What a residual is tested along.

    Attributes:
        alternatives: orthonormal bases (m, rank) of what each quantity reaches beyond the model, by its name.
        correlation: of the noise.
    """

    alternatives: dict[str, Array]
    correlation: NoiseCorrelation

    @property
    def count(self) -> int:
        """Number of tests."""
        return len(self.alternatives)


def diagnose_residual(fit: Fit, moving: bool, rms: float) -> ResidualDiagnosis:
    """Test the whitened residual of a fit for structure; ``rms`` [m] is its size, ``moving``: of a continuous run."""
    # 8_000: samples that the tests look at, fewer if a reading has more than three numbers
    problem = fit.problem.take(even_positions(len(fit.problem), subset_size(fit.model, 8_000)))
    rest = ProjectedResidual.of(problem, fit.errors, moving)
    tests = build_battery(without_noise(problem, fit.errors), rest, moving)
    unit = fit.setup.gauge.unit
    found = NO_DIAGNOSIS if tests is None else run_battery(rest, tests, moving, rms, unit)
    noise = fit.problem.whitener.declared_rms
    if rms <= LARGE_NOISE_RATIO * noise:
        return found
    return replace(found, sentence=_excess_text(found, rms, noise, unit))


def without_noise(problem: FitProblem, errors: Array) -> FitProblem:
    """Return the problem at angles that bring the fitted arm to the ball or socket which it was led to.

    There the noise is in the angles, and a curve of them would be a curve of the very noise that is looked at.
    """
    if not problem.model.setup.gauge.at_balls:
        return problem
    for _ in range(4):  # steps to the angles at which the fitted arm is in a ball
        s = problem.samples
        step = np.linalg.pinv(problem.model.joint_rows(s)) @ problem.residual(errors)[:, :, None]
        problem = replace(problem, samples=replace(s, q=read_only(s.q + step[:, :, 0])), memory=ProblemCache())
    return problem


def _excess_text(found: ResidualDiagnosis, rms: float, noise: float, unit: str) -> str:
    """Say that more is left than the noise that gauge and repeatability are declared to have."""
    more = (
        f"What is left, {rms * 1e3:.3g} {unit} rms, is {rms / noise:.1f} times the noise that gauge and robot are said "
        f"to have ({noise * 1e3:.3g} {unit})"
    )
    if found.structured:
        return f"{found.sentence} {more}."
    return f"{more}: it is not that noise, and no test tells what it follows."


def build_battery(problem: FitProblem, rest: ProjectedResidual, moving: bool) -> ResidualBattery | None:
    """Return the tests that the samples allow, with as much detail as they bear; ``None`` if they bear none."""
    for detail in range(3, 0, -1):  # harmonics of an angle, powers of a length or a time
        joints = rest.bases_beyond(problem, joint_columns(problem, detail))
        if not joints:  # no joint moves
            return None
        correlation = NoiseCorrelation()
        if moving:
            correlation = noise_correlation(rest, orthonormal_basis(np.concatenate(list(joints.values()), axis=1)))
        # 3.0: degrees of freedom for each alternative, below which fewer harmonics are tried
        most = rest.dof / correlation.time / (3.0 + 1)
        if correlation.dof < FEWEST_DOF or max(U.shape[1] for U in joints.values()) > most:
            continue
        others = rest.bases_beyond(problem, alternative_columns(problem, detail))
        every = joints | {name: U for name, U in others.items() if U.shape[1] <= most}
        return ResidualBattery({name: U for name, U in every.items() if U.shape[1]}, correlation)
    return None


def run_battery(
    rest: ProjectedResidual, tests: ResidualBattery, moving: bool, rms: float, unit: str = "mm"
) -> ResidualDiagnosis:
    """Judge a residual; ``rms`` [m] is its size, of which each alternative takes its share, a thousandth a ``unit``."""
    rest = rest.clip_outliers()
    trials, many, correlation = list[ResidualTest](), tests.count + (not moving), tests.correlation
    if not moving:
        trials.append(_order_test(rest, many, rms))
        if trials[0].p_value < SIGNIFICANCE:
            correlation = _correlation_at_rest(rest, tests)
    trials += [_f_test(rest, name, U, correlation, many, rms) for name, U in tests.alternatives.items()]
    found = tuple(sorted((t for t in trials if t.p_value < SIGNIFICANCE), key=lambda t: (-t.rms, t.along)))
    bases = [tests.alternatives[t.along] for t in found if t.along != MEASURING_ORDER]
    sizes = [t.rms for t in found[:1]]
    if bases:
        sizes.append(_explained_size(rest, orthonormal_basis(np.concatenate(bases, axis=1)), correlation, rms))
    share = max(sizes, default=0.0)
    return ResidualDiagnosis(tuple(trials), found, share, _verdict(trials, found, share, unit))


def _f_test(
    rest: ProjectedResidual, name: str, U: Array, correlation: NoiseCorrelation, many: int, rms: float
) -> ResidualTest:
    """F test of what one basis explains, as many samples as are correlated counting as one."""
    rank, explained = U.shape[1], _explained_squares(rest, U)
    dof = min(rest.dof / correlation.time - rank, correlation.dof)
    if dof < 1:
        return ResidualTest(name, 1.0, 0.0)
    ratio = explained / rank / correlation.time / max((rest.square - explained) / (rest.dof - rank), 1e-300)
    p = min(1.0, float(fdtrc(rank, dof, ratio)) * many)
    return ResidualTest(name, p, _explained_size(rest, U, correlation, rms))


def _explained_squares(rest: ProjectedResidual, U: Array) -> float:
    """Sum of squares that a basis explains."""
    return float(((U.T @ rest.white) ** 2).sum())


def _explained_size(rest: ProjectedResidual, U: Array, correlation: NoiseCorrelation, rms: float) -> float:
    """Size of what a basis explains beyond chance [m]."""
    beyond_chance = max(0.0, _explained_squares(rest, U) - U.shape[1] * correlation.time)
    return float(rms * np.sqrt(beyond_chance / max(rest.square, 1e-300)))


def _order_test(rest: ProjectedResidual, many: int, rms: float) -> ResidualTest:
    """Whether a pose errs as the poses measured just before it do (Ljung and Box 1978), the components together."""
    x = rest.white.reshape(-1, rest.width)
    n, power = len(x), max(rest.square, 1e-300)
    lags = range(1, min(5, n - 1) + 1)  # lags of the order of measuring
    rho = np.array([float((x[k:] * x[:-k]).sum()) / power for k in lags])
    Q = n * (n + 2) * rest.width * float((rho**2 / (n - np.array(lags))).sum())
    p = min(1.0, float(chdtrc(len(rho), Q)) * many)
    return ResidualTest(MEASURING_ORDER, p, float(rms * np.sqrt(max(0.0, rho.max(initial=0.0)))))


def _correlation_at_rest(rest: ProjectedResidual, tests: ResidualBattery) -> NoiseCorrelation:
    """Autocorrelation over poses at rest whose order matters, after everything that the tests look for.

    As many of the alternatives are projected out as leave half of the degrees of freedom.
    """
    bases, rank = [np.zeros((len(rest.white), 0))], 0
    for U in tests.alternatives.values():
        if rank + U.shape[1] <= rest.dof / 4:
            bases.append(U)
            rank += U.shape[1]
    known = noise_correlation(rest, orthonormal_basis(np.concatenate(bases, axis=1)))
    return known if known.dof >= FEWEST_DOF else NoiseCorrelation(1.0, FEWEST_DOF)


def _verdict(trials: Sequence[ResidualTest], found: Sequence[ResidualTest], rms: float, unit: str) -> str:
    if not trials:
        return TOO_FEW
    if not found:
        return f"What is left looks random in {'the one test' if len(trials) == 1 else f'all {len(trials)} tests'}."
    names = ", ".join(t.along for t in found)
    return f"What is left is not random: {rms * 1e3:.3g} {unit} (rms) of it follows {names}."
