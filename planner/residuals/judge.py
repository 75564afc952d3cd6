"""Is what the fit leaves chance? A test of the whitened residual along everything that was logged.

Along each quantity the alternatives are smooth functions of it (harmonics of an angle), in the reading and in the
joints' angles. The fitted parameters are projected out of them first, so that only what the model cannot take up
counts; then an F test each, Bonferroni over all. Readings of one group (a pose with its repeats) count as one, and
along a continuous run as many samples as are correlated count as one. Of poses at rest the order is tested too (Ljung
and Box 1978); where it matters, they count like a continuous run. Far outliers are pulled in (a score test by Huber's
ψ), so that heavy tails are not taken for structure.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher

from planner.identification import Calibration, Problem
from planner.identification.leftover import Leftover, Trial
from planner.repeatable import evenly
from planner.residuals.along import joints, others
from planner.residuals.rest import Memory, Rest, memory, spanned
from planner.units import Array

LEVEL = 0.01  # chance that any test of a clean residual calls
DETAIL = 3  # harmonics of an angle, powers of a length or a time
MOST = 8_000  # samples that the tests look at
FEWEST = 10.0  # degrees of freedom of the correlation time, below which nothing is said
SPARE = 3.0  # degrees of freedom for each alternative, below which fewer harmonics are tried
LAGS = 5  # of the order of measuring
ORDER = "order of measuring"
TOO_FEW = "There are too few readings beyond the parameters to tell what is left from chance."
NOTHING = Leftover((), (), 0.0, TOO_FEW)


@dataclass(frozen=True)
class Battery:
    """What a residual is tested along: names and orthonormal bases (m, rank) beyond the model; ``memory`` of noise."""

    names: tuple[str, ...]
    bases: tuple[Array, ...]
    memory: Memory

    @property
    def count(self) -> int:
        """Number of tests."""
        return len(self.names)


def leftover(calibration: Calibration) -> Leftover:
    """Test the whitened residual of the last stage for structure."""
    c = calibration
    which = evenly(len(c.run), MOST)
    problem = c.fit.problem.take(which)
    rest = Rest.of(problem, c.fit.errors, c.run.continuous)
    tests = battery_of(problem, rest, c.run.continuous)
    return NOTHING if tests is None else judged(rest, tests, c.run.continuous, c.stages[-1].train.rms)


def battery_of(problem: Problem, rest: Rest, moving: bool) -> Battery | None:
    """Return the tests that the samples allow, with as much detail as they bear; ``None`` if they bear none."""
    for detail in range(DETAIL, 0, -1):
        turned = {name: rest.beyond(problem, columns) for name, columns in joints(problem, detail)}
        known = memory(rest, spanned(np.concatenate(list(turned.values()), axis=1))) if moving else Memory()
        most = rest.dof / known.time / (SPARE + 1)
        if known.dof < FEWEST or max(U.shape[1] for U in turned.values()) > most:
            continue
        more = {name: rest.beyond(problem, columns) for name, columns in others(problem, detail)}
        kept = turned | {name: U for name, U in more.items() if U.shape[1] <= most}
        shown = {name: U for name, U in kept.items() if U.shape[1]}
        return Battery(tuple(shown), tuple(shown.values()), known)
    return None


def judged(rest: Rest, tests: Battery, moving: bool, rms: float) -> Leftover:
    """Judge a residual; ``rms`` [m] is its size, of which each alternative takes its share."""
    rest = rest.tame
    trials = list[Trial]()
    if not moving:
        trials.append(_order(rest, tests.count + 1, rms))
        if trials[0].p_value < LEVEL:
            tests = replace(tests, memory=_careful(rest, tests))
    each, many = zip(tests.names, tests.bases, strict=True), tests.count + (not moving)
    trials += [_along(rest, tests, n, U, many, rms) for n, U in each]
    found = tuple(sorted((t for t in trials if t.p_value < LEVEL), key=lambda t: (-t.rms, t.along)))
    share = 0.0
    if found:
        bases = [tests.bases[tests.names.index(t.along)] for t in found if t.along != ORDER]
        share = max(
            _share(rest, spanned(np.concatenate(bases, axis=1)), tests.memory, rms) if bases else 0.0, found[0].rms
        )
    return Leftover(tuple(trials), found, share, _sentence(trials, found, share))


def _along(rest: Rest, tests: Battery, name: str, U: Array, many: int, rms: float) -> Trial:
    """F test of what one basis explains, more samples than one being worth one."""
    rank, worth = U.shape[1], tests.memory.time
    inner = float(((U.T @ rest.white) ** 2).sum())
    dof = min(rest.dof / worth - rank, tests.memory.dof)
    if dof < 1:
        return Trial(name, 1.0, 0.0)
    ratio = inner / rank / worth / max((rest.square - inner) / (rest.dof - rank), 1e-300)
    return Trial(name, min(1.0, float(fisher.sf(ratio, rank, dof)) * many), _share(rest, U, tests.memory, rms))


def _share(rest: Rest, U: Array, known: Memory, rms: float) -> float:
    """Size of what a basis explains beyond chance [m]."""
    inner = float(((U.T @ rest.white) ** 2).sum())
    return float(rms * np.sqrt(max(0.0, inner - U.shape[1] * known.time) / max(rest.square, 1e-300)))


def _order(rest: Rest, many: int, rms: float) -> Trial:
    """Whether a pose errs as the poses measured just before it do (Ljung and Box 1978), the components together."""
    x = rest.white.reshape(-1, rest.width)
    n, power = len(x), max(rest.square, 1e-300)
    lags = range(1, min(LAGS, n - 1) + 1)
    rho = np.array([float((x[k:] * x[:-k]).sum()) / power for k in lags])
    Q = n * (n + 2) * rest.width * float((rho**2 / (n - np.array(lags))).sum())
    p = min(1.0, float(chi2.sf(Q, len(rho))) * many)
    return Trial(ORDER, p, float(rms * np.sqrt(max(0.0, rho.max(initial=0.0)))))


def _careful(rest: Rest, tests: Battery) -> Memory:
    """Memory of poses at rest whose order matters, after everything that the tests look for."""
    known = memory(rest, _within(rest, tests.bases))
    return known if known.dof >= FEWEST else Memory(1.0, FEWEST)


def _within(rest: Rest, bases: Sequence[Array]) -> Array:
    """As many of the bases as leave half of the degrees of freedom, joined, (m, k)."""
    taken = list[Array]()
    for U in bases:
        if sum(V.shape[1] for V in taken) + U.shape[1] <= rest.dof / 4:
            taken.append(U)
    return spanned(np.concatenate(taken, axis=1)) if taken else np.zeros((len(rest.white), 0))


def _sentence(trials: Sequence[Trial], found: Sequence[Trial], rms: float) -> str:
    if not trials:
        return TOO_FEW
    if not found:
        return f"What is left is chance, as far as {len(trials)} tests can tell."
    names = ", ".join(t.along for t in found)
    return f"What is left is not only chance: {rms * 1e3:.3g} mm (rms) of it follows {names}."
