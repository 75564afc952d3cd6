"""Tests of the whitened residual for structure along everything that was logged.

The fitted parameters are projected out of the alternatives; then one F test each, with Bonferroni's correction.
Readings of one pose count as one, and along a continuous run correlated samples count as one. Of poses at rest the
order of measuring is tested too (Ljung and Box 1978). Far outliers are clipped (a score test by Huber's psi)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.identification.calibration import ResidualDiagnosis, ResidualTest
from planner.identification.covariance import correlation_time
from planner.identification.cross_validation import number_poses
from planner.identification.least_squares import MEDIAN_RMS, Fit
from planner.identification.problem import FitProblem
from planner.identification.residual_alternatives import joint_columns, other_columns

VISIBLE_SHARE = 1e-3  # part of a column that must be left beyond the model for it to count
HUBER_BOUND = 2.5  # standard deviations
MOST_ABSORBED = 0.8  # part of the slow noise that may be taken out before its memory is no longer known


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
        group = np.arange(len(problem)) if moving else pose_groups(problem)
        piece = problem.piece(slice(None), errors)
        basis = np.linalg.qr(group_sums(piece.rows, group))[0]
        white = group_sums(problem.white_residual(errors)[..., None], group)[:, 0]
        return cls(white - basis @ (basis.T @ white), basis, group, problem.model.width)

    @property
    def dof(self) -> float:
        """Degrees of freedom that the model leaves."""
        return float(len(self.white) - self.basis.shape[1])

    @cached_property
    def square(self) -> float:
        """Sum of squares."""
        return float(self.white @ self.white)

    @property
    def tame(self) -> "ProjectedResidual":
        """The same with numbers beyond ``FAR`` robust standard deviations brought there, the model taken out anew."""
        far = HUBER_BOUND * float(np.median(np.abs(self.white))) / MEDIAN_RMS[1]
        white = np.clip(self.white, -far, far)
        return replace(self, white=white - self.basis @ (self.basis.T @ white))

    def beyond(self, problem: FitProblem, columns: Array) -> Array:
        """Orthonormal basis (m, rank) of what columns (n, r, k) of the reading reach beyond the model."""
        tall = group_sums(problem.whitener.white(slice(None), columns), self.group)
        tall = tall / np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
        tall = tall - self.basis @ (self.basis.T @ tall)
        return orthonormal_basis(tall - self.basis @ (self.basis.T @ tall))


def orthonormal_basis(tall: Array) -> Array:
    """Orthonormal basis (m, rank) of columns (m, k) of about unit length, those shorter than ``SHOWN`` left out."""
    size, axes = np.linalg.eigh(tall.T @ tall)
    shown = size > VISIBLE_SHARE**2
    return np.asarray(tall @ (axes[:, shown] / np.sqrt(size[shown])))


def pose_groups(problem: FitProblem) -> np.ndarray:
    """Number the poses, each at its place and target, in the order in which they were first measured, (m,)."""
    s = problem.samples
    point = np.zeros(len(s), dtype=int) if s.point is None else s.point
    label = np.stack([number_poses(s.q), s.place, point], axis=1)
    first, group = np.unique(label, axis=0, return_index=True, return_inverse=True)[1:]
    return np.argsort(np.argsort(first))[group.reshape(-1)]


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
    """How long noise stays what it is: so many samples are worth one, known with so many degrees of freedom."""

    time: float = 1.0
    dof: float = np.inf


def noise_correlation(rest: ProjectedResidual, taken: Array) -> NoiseCorrelation:
    """Find the memory of what the columns ``taken`` (m, k), orthonormal and beyond the model, do not explain.

    Model and alternatives change slowly along the drive: with them a part of the slow noise is taken out, from which
    the time is read. Over the window of that reading (Sokal's, 5 times either way) it is trace(BᵀTB)/n, B the basis of
    all that was taken out, T one within the window. The time scatters as a sum of 10·time correlations does.
    """
    left = (rest.white - taken @ (taken.T @ rest.white)).reshape(-1, rest.width)
    seen = max(correlation_time(of_one) for of_one in left.T)
    out = np.concatenate([rest.basis, taken], axis=1).reshape(len(left), -1)
    window = int(np.ceil(5 * seen))
    total = np.cumsum(np.pad(out, ((window + 1, window), (0, 0))), axis=0)
    gone = float((out * (total[2 * window + 1 :] - total[: -2 * window - 1])).sum()) / (len(left) * rest.width)
    if gone > MOST_ABSORBED:
        return NoiseCorrelation(np.inf, 0.0)
    time = seen / (1 - gone)
    return NoiseCorrelation(time, len(left) / (10 * time + 1))


SIGNIFICANCE = 0.01  # chance that any test of a clean residual calls
MAX_DETAIL = 3  # harmonics of an angle, powers of a length or a time
TESTED_SAMPLES = 8_000  # samples that the tests look at
FEWEST_DOF = 10.0  # degrees of freedom of the correlation time, below which nothing is said
DOF_PER_ALTERNATIVE = 3.0  # degrees of freedom for each alternative, below which fewer harmonics are tried
LAGS = 5  # of the order of measuring
MEASURING_ORDER = "order of measuring"
TOO_FEW = "There are too few readings beyond the parameters to tell what is left from chance."
NO_DIAGNOSIS = ResidualDiagnosis((), (), 0.0, TOO_FEW)


@dataclass(frozen=True)
class ResidualBattery:
    """What a residual is tested along: names and orthonormal bases (m, rank) beyond the model; ``memory`` of noise."""

    names: tuple[str, ...]
    bases: tuple[Array, ...]
    memory: NoiseCorrelation

    @property
    def count(self) -> int:
        """Number of tests."""
        return len(self.names)


def diagnose_residual(fit: Fit, moving: bool, rms: float) -> ResidualDiagnosis:
    """Test the whitened residual of a fit for structure; ``rms`` [m] is its size, ``moving``: of a continuous run."""
    problem = fit.problem.take(even_positions(len(fit.problem), TESTED_SAMPLES))
    rest = ProjectedResidual.of(problem, fit.errors, moving)
    tests = build_battery(problem, rest, moving)
    return NO_DIAGNOSIS if tests is None else run_battery(rest, tests, moving, rms)


def build_battery(problem: FitProblem, rest: ProjectedResidual, moving: bool) -> ResidualBattery | None:
    """Return the tests that the samples allow, with as much detail as they bear; ``None`` if they bear none."""
    for detail in range(MAX_DETAIL, 0, -1):
        turned = {name: rest.beyond(problem, columns) for name, columns in joint_columns(problem, detail)}
        known = (
            noise_correlation(rest, orthonormal_basis(np.concatenate(list(turned.values()), axis=1)))
            if moving
            else NoiseCorrelation()
        )
        most = rest.dof / known.time / (DOF_PER_ALTERNATIVE + 1)
        if known.dof < FEWEST_DOF or max(U.shape[1] for U in turned.values()) > most:
            continue
        more = {name: rest.beyond(problem, columns) for name, columns in other_columns(problem, detail)}
        kept = turned | {name: U for name, U in more.items() if U.shape[1] <= most}
        shown = {name: U for name, U in kept.items() if U.shape[1]}
        return ResidualBattery(tuple(shown), tuple(shown.values()), known)
    return None


def run_battery(rest: ProjectedResidual, tests: ResidualBattery, moving: bool, rms: float) -> ResidualDiagnosis:
    """Judge a residual; ``rms`` [m] is its size, of which each alternative takes its share."""
    rest = rest.tame
    trials = list[ResidualTest]()
    if not moving:
        trials.append(_order_test(rest, tests.count + 1, rms))
        if trials[0].p_value < SIGNIFICANCE:
            tests = replace(tests, memory=_autocorrelation_at_rest(rest, tests))
    each, many = zip(tests.names, tests.bases, strict=True), tests.count + (not moving)
    trials += [_f_test(rest, tests, n, U, many, rms) for n, U in each]
    found = tuple(sorted((t for t in trials if t.p_value < SIGNIFICANCE), key=lambda t: (-t.rms, t.along)))
    share = 0.0
    if found:
        bases = [tests.bases[tests.names.index(t.along)] for t in found if t.along != MEASURING_ORDER]
        share = max(
            _explained_size(rest, orthonormal_basis(np.concatenate(bases, axis=1)), tests.memory, rms)
            if bases
            else 0.0,
            found[0].rms,
        )
    return ResidualDiagnosis(tuple(trials), found, share, _verdict(trials, found, share))


def _f_test(
    rest: ProjectedResidual, tests: ResidualBattery, name: str, U: Array, many: int, rms: float
) -> ResidualTest:
    """F test of what one basis explains, more samples than one being worth one."""
    from scipy.stats import f as fisher  # costs most of a second

    rank, worth = U.shape[1], tests.memory.time
    inner = float(((U.T @ rest.white) ** 2).sum())
    dof = min(rest.dof / worth - rank, tests.memory.dof)
    if dof < 1:
        return ResidualTest(name, 1.0, 0.0)
    ratio = inner / rank / worth / max((rest.square - inner) / (rest.dof - rank), 1e-300)
    return ResidualTest(
        name, min(1.0, float(fisher.sf(ratio, rank, dof)) * many), _explained_size(rest, U, tests.memory, rms)
    )


def _explained_size(rest: ProjectedResidual, U: Array, known: NoiseCorrelation, rms: float) -> float:
    """Size of what a basis explains beyond chance [m]."""
    inner = float(((U.T @ rest.white) ** 2).sum())
    return float(rms * np.sqrt(max(0.0, inner - U.shape[1] * known.time) / max(rest.square, 1e-300)))


def _order_test(rest: ProjectedResidual, many: int, rms: float) -> ResidualTest:
    """Whether a pose errs as the poses measured just before it do (Ljung and Box 1978), the components together."""
    x = rest.white.reshape(-1, rest.width)
    n, power = len(x), max(rest.square, 1e-300)
    lags = range(1, min(LAGS, n - 1) + 1)
    rho = np.array([float((x[k:] * x[:-k]).sum()) / power for k in lags])
    Q = n * (n + 2) * rest.width * float((rho**2 / (n - np.array(lags))).sum())
    from scipy.stats import chi2  # costs most of a second

    p = min(1.0, float(chi2.sf(Q, len(rho))) * many)
    return ResidualTest(MEASURING_ORDER, p, float(rms * np.sqrt(max(0.0, rho.max(initial=0.0)))))


def _autocorrelation_at_rest(rest: ProjectedResidual, tests: ResidualBattery) -> NoiseCorrelation:
    """Memory of poses at rest whose order matters, after everything that the tests look for."""
    known = noise_correlation(rest, _join_bases(rest, tests.bases))
    return known if known.dof >= FEWEST_DOF else NoiseCorrelation(1.0, FEWEST_DOF)


def _join_bases(rest: ProjectedResidual, bases: Sequence[Array]) -> Array:
    """As many of the bases as leave half of the degrees of freedom, joined, (m, k)."""
    taken = list[Array]()
    for U in bases:
        if sum(V.shape[1] for V in taken) + U.shape[1] <= rest.dof / 4:
            taken.append(U)
    return orthonormal_basis(np.concatenate(taken, axis=1)) if taken else np.zeros((len(rest.white), 0))


def _verdict(trials: Sequence[ResidualTest], found: Sequence[ResidualTest], rms: float) -> str:
    if not trials:
        return TOO_FEW
    if not found:
        return f"What is left is chance, as far as {len(trials)} tests can tell."
    names = ", ".join(t.along for t in found)
    return f"What is left is not only chance: {rms * 1e3:.3g} mm (rms) of it follows {names}."
