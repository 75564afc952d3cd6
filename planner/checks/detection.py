"""Whether a few readings differ from what is expected.

Readings less their expectation, whitened and freed of all that is set up anew for a session, are standard normal if
nothing has changed, times one unknown scale that the baseline's noise is known to. Every possible change has columns;
what its columns explain, T, is F-distributed then (score test by generalised least squares, Rao 1948). The smallest of
all probabilities is held against a threshold that draws have put where all tests together give a false alarm in one of
a hundred sound robots: the tests share readings, so that Bonferroni would ask for too much (Westfall and Young 1993,
min-P).
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from planner.checks.assumptions import FALSE_ALARM, POWER, UNSEEN_SHARE
from planner.common.lazy_modules import optimize, stats
from planner.common.units import Array

DRAWS = 40_000  # of noise, by which probabilities are found: 400 of them below a false alarm of 0.01
SEED = 17  # fixed: the same readings give the same verdict


@dataclass(frozen=True)
class Explanation:
    """How well one change explains the readings.

    Attributes:
        which: number of the change; one more than there are for anything at all.
        explained: T, sum of the squares that it takes away.
        freedom: its degrees d.
        p_value: of T if nothing had changed.
    """

    which: int
    explained: float
    freedom: int
    p_value: float


@dataclass(frozen=True)
class Detector:
    """Tests for changes in n readings.

    Attributes:
        covariance: of readings less their expectation where nothing has changed, (n, n) [m²].
        columns: of every possible change, (n, d) [m per unit].
        freedom: degrees of freedom of the estimate of the covariance's size.
        anew: columns of what every session sets up anew, (n, a) [m]; a change along them does not show.
    """

    covariance: Array
    columns: tuple[Array, ...]
    freedom: float
    anew: Array | None = None

    @cached_property
    def _root(self) -> Array:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))

    @cached_property
    def _whitening(self) -> Array:
        """Turns n readings into m that are white and that nothing which is set up anew moves, (m, n)."""
        if self.anew is None:
            return self._root
        left, size, _ = np.linalg.svd(self._root @ self.anew)
        return np.asarray(left[:, int((size > UNSEEN_SHARE * size.max(initial=0.0)).sum()) :].T @ self._root)

    def white(self, values: Array) -> Array:
        """Return readings (n,) or columns of them (n, k) as whitened, (m, …)."""
        return np.asarray(self._whitening @ values)

    @cached_property
    def _bases(self) -> tuple[Array, ...]:
        """Orthonormal bases of what each change does to the white readings; the last is of anything, (m, d) each."""
        out = []
        for c in self.columns:
            left, size, _ = np.linalg.svd(self._whitening @ c, full_matrices=False)
            out.append(left[:, size > UNSEEN_SHARE * max(float(np.linalg.norm(self._root @ c)), 1e-300)])
        return (*out, np.eye(len(self._whitening)))

    @cached_property
    def std(self) -> Array:
        """Expected size of readings less their expectation once what is set up anew is taken off, (n,) [m]."""
        return np.asarray(np.linalg.norm(self._whitening @ self.covariance, axis=0))

    @property
    def shows(self) -> tuple[bool, ...]:
        """Whether each change shows at all, beside what is set up anew."""
        return tuple(b.shape[1] > 0 for b in self._bases[:-1])

    def explain(self, difference: Array) -> tuple[Explanation, ...]:
        """Return how much each change explains of the readings' deviation (n,) [m]; the last entry: any change."""
        explained = np.array([((self._whitening @ difference @ b) ** 2).sum() for b in self._bases])
        d = np.array([b.shape[1] for b in self._bases])
        p = stats.f.sf(explained / d, d, self.freedom)
        return tuple(Explanation(k, float(explained[k]), int(d[k]), float(p[k])) for k in range(len(d)))

    def _log_tails(self, explained: Array) -> Array:
        """Return the logarithms of those probabilities (m, H + 1), from tables: a thousand times as quick."""
        out = np.empty_like(explained)
        for d in {b.shape[1] for b in self._bases}:
            mine = [k for k, b in enumerate(self._bases) if b.shape[1] == d]
            table = np.geomspace(1e-4, 1e6, 4000)  # entries of a table of probabilities
            out[:, mine] = np.interp(explained[:, mine] / d, table, stats.f.logsf(table, d, self.freedom))
        return out

    @cached_property
    def threshold(self) -> float:
        """Probability below which the smallest of all gives an alarm."""
        rng, n = np.random.default_rng(SEED), len(self._whitening)
        scale = np.sqrt(rng.chisquare(self.freedom, DRAWS) / self.freedom)
        white = rng.standard_normal((DRAWS, n)) / scale[:, None]
        explained = np.stack([((white @ b) ** 2).sum(axis=1) for b in self._bases], axis=1)
        smallest = np.sort(self._log_tails(explained).min(axis=1))
        expected = FALSE_ALARM * DRAWS
        # two sigmas of the draws' own scatter keep the false alarms below what is stated
        return float(np.exp(smallest[int(expected - 2.0 * np.sqrt(expected))]))

    def estimate(self, which: int, size: Array, difference: Array) -> tuple[Array, Array]:
        """Return values (d,) and covariance (d, d) of a change from readings (n,) [m], the least where many would do.

        ``size`` (d,): of values that count as alike.
        """
        white = (self._whitening @ self.columns[which]) * size
        back = np.linalg.pinv(white, rcond=UNSEEN_SHARE) * size[:, None]
        return np.asarray(back @ self._whitening @ difference), np.asarray(back @ back.T)

    def detectable_motion(self, which: int, square: Array) -> float:
        """Return the least motion of the tool [m] that is found with ``POWER`` whatever way the change goes.

        ``square`` (d, d): mean square motion of the tool per squared size of the change.
        """
        white = self._whitening @ self.columns[which]
        return detectable_motion(white.T @ white, square, self._bases[which].shape[1], self.freedom, self.threshold)


def detectable_motion(information: Array, square: Array, d: int, freedom: float, threshold: float) -> float:
    """Return the largest motion of the tool [m] that still hides, of a change with this information, both (d, d).

    Where many things move at once some ways to move hide for ever: of those it is what nine of ten ways show.
    """
    needed = shift_for_power(d, round(freedom, 3), threshold)
    if len(square) > 3:  # parameters of a change from which on not every way it may go is looked at
        ways = np.random.default_rng(SEED).standard_normal((DRAWS // 10, len(square))) / np.sqrt(np.diag(square))
        size, shown = (np.einsum("mi,ij,mj->m", ways, m, ways) for m in (square, information))
        return float(np.sqrt(needed * np.quantile(size / shown, 0.9)))
    root = np.linalg.cholesky(square + 1e-15 * np.trace(square) * np.eye(len(square)))
    inner = np.linalg.solve(root, np.linalg.solve(root, information).T)  # per squared metre of motion
    least = float(np.linalg.eigvalsh((inner + inner.T) / 2)[0])
    return float(np.sqrt(needed / least)) if least > 0 else np.inf


@cache
def shift_for_power(d: int, freedom: float, threshold: float) -> float:
    """Return the noncentrality λ at which a test on (d, freedom) degrees finds a change with ``POWER``.

    λ counts in the noise as it was estimated, which is what sizes are stated by: averaged over what it may really be.
    """
    sizes = 200  # that the noise may have: quantiles of its distribution
    critical = stats.f.isf(threshold, d, freedom)
    true = freedom / stats.chi2.ppf((np.arange(sizes) + 0.5) / sizes, freedom)  # variance over the estimated one

    def missing_power(shift: float) -> float:
        """Return how much power a shift lacks."""
        return POWER - float(stats.ncx2.sf(critical * d / true, d, shift / true).mean())

    high = 10.0 * d * critical
    while missing_power(high) > 0:
        high *= 2.0
    return float(optimize.brentq(missing_power, 1e-6, high))
