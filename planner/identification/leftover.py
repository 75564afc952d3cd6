"""Is what the fit leaves chance? A test of the whitened residual along each joint, time and temperature.

Along a joint the alternatives are the first harmonics of its angle, both added to the reading itself and as an error
of that joint's angle (Jacobian column times harmonic). The fitted parameters are projected out of them first, so that
only what the model cannot take up counts; then an F test each, Bonferroni over all. Readings of one group (a pose
with its repeats) count as one, and along a continuous run as many samples as are correlated count as one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from planner.identification.problem import Problem
from planner.identification.splits import poses
from planner.identification.spread import correlation_time
from planner.identification.types import Calibration
from planner.units import Array

LEVEL = 0.01  # chance that any test of a clean residual calls
HARMONICS = 3
MOST = 20_000  # samples that the tests look at
FEWEST = 10.0  # degrees of freedom of the correlation time, below which nothing is said
MOST_GONE = 0.8  # part of the slow noise that may be taken out before its memory is no longer known
TOO_FEW = "There are too few readings beyond the parameters to tell what is left from chance."
SPARE = 3.0  # degrees of freedom for each alternative, below which fewer harmonics are tried


@dataclass(frozen=True)
class Trial:
    """One test: along what, how likely chance is after Bonferroni, rms of what follows it [m]."""

    along: str
    p_value: float
    rms: float


@dataclass(frozen=True)
class Leftover:
    """What the tests said.

    Attributes:
        trials: all of them, in order; empty where the run is too small.
        found: those that are not chance, the clearest first.
        rms: of what follows all of ``found`` together [m].
        sentence: the same in words.
    """

    trials: tuple[Trial, ...]
    found: tuple[Trial, ...]
    rms: float
    sentence: str

    @property
    def structured(self) -> bool:
        """Whether the residual is not chance."""
        return bool(self.found)


@dataclass(frozen=True)
class _Left:
    """Whitened residual (m,) with the model's columns (m, P) projected out; ``basis`` (m, P) is orthonormal."""

    white: Array
    basis: Array
    count: int
    dof: float

    def apart(self, columns: Array) -> Array:
        """Return an orthonormal basis (m, rank) of what the columns (m, k) reach beyond the model."""
        rest = columns - self.basis @ (self.basis.T @ columns)
        U, size, _ = np.linalg.svd(rest, full_matrices=False)
        return np.asarray(U[:, size > 1e-6 * float(np.linalg.norm(columns, axis=0).max(initial=1e-300))])

    def explained(self, columns: Array) -> tuple[float, int]:
        """Sum of squares of the residual that the columns explain, and their rank."""
        U = self.apart(columns)
        return float(((U.T @ self.white) ** 2).sum()), U.shape[1]


def leftover(calibration: Calibration) -> Leftover:
    """Test the whitened residual of the last stage for structure."""
    c = calibration
    which = np.unique(np.linspace(0, len(c.run) - 1, min(len(c.run), MOST)).astype(int))
    problem = c.fit.problem.take(which)
    group = which if c.run.continuous else _groups(problem)
    left = _left(problem, c.fit.errors, group)
    for harmonics in range(HARMONICS, 0, -1):
        rivals = {name: _summed(_white(problem, v), group) for name, v in _rivals(problem, harmonics).items()}
        widest = max(v.shape[1] for v in rivals.values())
        memory = _memory(left, rivals, problem.model.width) if c.run.continuous else _Memory(1.0, np.inf)
        if left.dof / memory.time >= (SPARE + 1) * widest and memory.dof >= FEWEST:
            return _judged(left, rivals, memory, c.stages[-1].train.rms)
    return Leftover((), (), 0.0, TOO_FEW)


def _left(problem: Problem, errors: Array, group: np.ndarray) -> _Left:
    piece = problem.piece(slice(None), errors)
    rows = _summed(piece.rows, group)
    basis = np.linalg.qr(rows)[0]
    white = _summed(problem.white_residual(errors)[..., None], group)[:, 0]
    white = white - basis @ (basis.T @ white)
    return _Left(white, basis, len(white), len(white) - rows.shape[1])


def _groups(problem: Problem) -> np.ndarray:
    """Number the poses, each at its place and target, (m,)."""
    s = problem.samples
    point = np.zeros(len(s), dtype=int) if s.point is None else s.point
    label = np.stack([poses(s.q), s.place, point], axis=1)
    return np.unique(label, axis=0, return_inverse=True)[1].reshape(-1)


def _summed(rows: Array, group: np.ndarray) -> Array:
    """Sum the rows (m, r, k) of each group over the root of its size, so that noise keeps its size; (groups·r, k)."""
    place = np.unique(group, return_inverse=True)[1]
    count = np.bincount(place)
    if len(count) == len(group):
        return rows.reshape(-1, rows.shape[2])
    out = np.zeros((len(count), *rows.shape[1:]))
    np.add.at(out, place, rows)
    return np.asarray(out / np.sqrt(count)[:, None, None]).reshape(-1, rows.shape[2])


def _rivals(problem: Problem, harmonics: int) -> dict[str, Array]:
    """Alternatives, name → columns (m, r, k) in the reading's units."""
    s, r = problem.samples, problem.model.width
    screws = problem.model.joint_rows(s)
    each = np.eye(r)
    out: dict[str, Array] = {}
    for j in range(s.q.shape[1]):
        angles = np.arange(1, harmonics + 1) * s.q[:, j, None]
        waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
        on_joint = screws[:, :, j, None] * waves[:, None]
        on_reading = np.einsum("mw,rs->mrsw", waves, each).reshape(len(s), r, -1)
        out[f"joint {j + 1}"] = np.concatenate([on_joint, on_reading], axis=2)
    for name, values in (("time", s.t), ("temperature", s.temperature)):
        if values is not None and np.ptp(values) > 0:
            x = 2 * (values - values.min()) / np.ptp(values) - 1
            curves = np.stack([x, x**2, x**3][:harmonics], axis=1)
            out[name] = np.einsum("mw,rs->mrsw", curves, each).reshape(len(s), r, -1)
    return out


def _white(problem: Problem, columns: Array) -> Array:
    return problem.whitener.white(slice(None), columns)


@dataclass(frozen=True)
class _Memory:
    """How long noise stays what it is: so many samples are worth one, known with so many degrees of freedom."""

    time: float
    dof: float


def _memory(left: _Left, rivals: dict[str, Array], width: int) -> _Memory:
    """Find the memory of what no alternative explains.

    Model and alternatives change slowly along the drive: with them a part of the slow noise is taken out, from which
    the time is read. Over the window of that reading (Sokal's, 5 times either way) it is trace(BᵀTB)/n, B the basis of
    all that was taken out, T one within the window. The time scatters as a sum of 10·time correlations does.
    """
    U = left.apart(np.concatenate(list(rivals.values()), axis=1))
    rest = (left.white - U @ (U.T @ left.white)).reshape(-1, width)
    seen = max(correlation_time(of_one) for of_one in rest.T)
    out = np.concatenate([left.basis, U], axis=1).reshape(len(rest), -1)
    window = int(np.ceil(5 * seen))
    total = np.cumsum(np.pad(out, ((window + 1, window), (0, 0))), axis=0)
    gone = float((out * (total[2 * window + 1 :] - total[: -2 * window - 1])).sum()) / (len(rest) * width)
    if gone > MOST_GONE:
        return _Memory(np.inf, 0.0)
    time = seen / (1 - gone)
    return _Memory(time, len(rest) / (10 * time + 1))


def _judged(left: _Left, rivals: dict[str, Array], memory: _Memory, rms: float) -> Leftover:
    """Test each alternative; ``rms`` is that of the residual [m], of which each takes its share."""
    total, worth = float(left.white @ left.white), memory.time
    trials = []
    for name, columns in rivals.items():
        inner, rank = left.explained(columns)
        dof = min(left.dof / worth - rank, memory.dof)
        if rank == 0:
            continue
        ratio = inner / rank / worth / max((total - inner) / (left.dof - rank), 1e-300)
        p = min(1.0, float(fisher.sf(ratio, rank, dof)) * len(rivals))
        trials.append(Trial(name, p, rms * np.sqrt(max(0.0, inner - rank * worth) / total)))
    found = tuple(sorted((t for t in trials if t.p_value < LEVEL), key=lambda t: (-t.rms, t.along)))
    share = 0.0
    if found:
        inner, rank = left.explained(np.concatenate([rivals[t.along] for t in found], axis=1))
        share = rms * np.sqrt(max(0.0, inner - rank * worth) / total)
    return Leftover(tuple(trials), found, float(share), _sentence(tuple(trials), found, float(share)))


def _sentence(trials: tuple[Trial, ...], found: tuple[Trial, ...], rms: float) -> str:
    if not trials:
        return TOO_FEW
    if not found:
        return f"What is left is chance, as far as {len(trials)} tests can tell."
    names = ", ".join(t.along for t in found)
    return f"What is left is not only chance: {rms * 1e3:.3g} mm (rms) of it follows {names}."
