"""What every part of the study starts from: candidates, what they see, index curves, a selection of poses."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.progress import Progress
from planner.common.units import Array, read_only
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.observability.identifiability import Identifiability
from planner.design.observability.information import INDEX_RULES, Covariance, predict_covariance, rms_sensitivity
from planner.design.pose_selection import identify_candidates
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_search import exchange_poses, find_knee
from planner.model.model import Model

ANNEALING_STEPS = 150  # for the index that was asked for; the others descend only
GROWTH = (1.04, 1.12, 1.25, 1.4, 1.6, 2.0, 2.5, 3.2, 4.0, 5.6, 8.0)  # numbers of poses, in parameters


@dataclass(frozen=True)
class BoundedCurve:
    """One index against the number of poses.

    Attributes:
        index: O1 … O5; ``scaled`` tells the unit-free one (columns times prior sigmas) from the raw one.
        sizes: numbers of poses (k,); ``values`` (k,) what a selection reaches; ``bounds`` (k,) what none can beat.
        knee: the number of poses where the curve bends.
    """

    index: str
    scaled: bool
    sizes: np.ndarray
    values: Array
    bounds: Array
    knee: int

    @property
    def scaling(self) -> str:
        """Whether its columns are raw or in prior sigmas, in words."""
        return "unit-free" if self.scaled else "raw"

    @property
    def at_knee(self) -> float:
        """The index that a selection reaches at the bend."""
        return float(self.values[self.sizes == self.knee][0])

    @property
    def limit_at_knee(self) -> float:
        """What no set of as many poses as at the bend can beat."""
        return float(self.bounds[self.sizes == self.knee][0])


def compute_index_curves(rows: Array, prior: Array, asked: str, seed: int, say: Progress) -> tuple[BoundedCurve, ...]:
    """Return the curves of O1 … O5, first raw, then unit-free.

    Args:
        rows: identifiable columns of the candidates, (n, r, p).
        prior: sizes of the parameters, (p,) [m or rad].
        asked: the index that is searched for hardest.
        seed: of the selection.
        say: told of the progress.
    """
    fewest = -(-rows.shape[2] // rows.shape[1])
    sizes = np.unique([min(len(rows), max(fewest, round(fewest * g))) for g in GROWTH])
    out: list[BoundedCurve] = []
    for scaled in (False, True):
        scene = np.ascontiguousarray(rows * prior) if scaled else rows
        for index, certificates in _any_size_certificates(scene, seed).items():
            say("index curves", len(out), 2 * len(INDEX_RULES))
            out.append(
                _compute_curve(
                    scene, index, scaled, sizes, certificates, seed, ANNEALING_STEPS if index == asked else 0
                )
            )
    return tuple(out)


def find_curve(curves: tuple[BoundedCurve, ...], index: str, scaled: bool) -> BoundedCurve:
    """Return the curve of one index."""
    return next(c for c in curves if c.index == index and c.scaled == scaled)


def _any_size_certificates(rows: Array, seed: int) -> dict[str, tuple[Certificate, ...]]:
    """Proofs for designs of any size: of a single unit of weight for the indices that grow with every pose."""
    sizes = {"O1": None, "O2": None, "O3": 1, "O5": 1}
    # 0.02: [1] gap: a curve is read by eye, its bound is a proof whatever the tolerance
    proofs = {index: certify_bound(rows, index, poses, 0.02, seed) for index, poses in sizes.items()}
    return {index: (proofs["O3"], proofs["O2"]) if index == "O4" else (proofs[index],) for index in INDEX_RULES}


def _compute_curve(
    rows: Array, index: str, scaled: bool, sizes: np.ndarray, proofs: tuple[Certificate, ...], seed: int, steps: int
) -> BoundedCurve:
    """The values reached, and what no set of as many candidates beats.

    O1 and O2 do not depend on the number; n poses carry at most n times the information of the best unit of
    weight, so that O3 and O5, which go with the root of it, grow at most with √n; O4 = O3 / O2.
    """
    # 800: candidates that the last descents look at
    values = np.array([exchange_poses(rows, int(n), index, 1, seed, proofs[-1], steps, 800).value for n in sizes])
    bounds = proofs[0].value * (np.ones(len(sizes)) if index in ("O1", "O2") else np.sqrt(sizes))
    bounds = bounds / proofs[1].value if index == "O4" else bounds
    return BoundedCurve(index, scaled, sizes, read_only(values), read_only(bounds), find_knee(sizes, values, index))


CANDIDATES = 5000  # enough for every finding of the study; the plan itself looks among more


@dataclass(frozen=True)
class StudyBasis:
    """Candidates and chosen poses of the cell as it is.

    Attributes:
        cell, index, seed: what was asked; index one of O1 … O5.
        pool: candidates of all fixtures.
        whole: the model with all parameters that the cell frees; ``whole_rows`` (n, r, P) its Jacobian.
        model: the identifiable parameters only; ``rows`` (n, r, p) theirs; ``seen`` why the others are left out.
        curves: index against number of poses, for every index, raw and unit-free.
        poses: how many the plan would take; ``chosen`` (poses,) positions in the pool.
        predicted: covariance of the parameters after measuring the chosen poses once.
        noise: of a typical reading [m].
    """

    cell: Cell
    index: str
    seed: int
    pool: PoseSet
    whole: Model
    whole_rows: Array
    model: Model
    rows: Array
    seen: Identifiability
    curves: tuple[BoundedCurve, ...]
    poses: int
    chosen: np.ndarray
    predicted: Covariance
    noise: float

    @property
    def curve(self) -> BoundedCurve:
        """The raw curve of the index that was asked for."""
        return find_curve(self.curves, self.index, scaled=False)

    @property
    def absorbers(self) -> dict[str, list[str]]:
        """For each kept parameter the dropped ones whose error it also carries."""
        parts = [(d.name, {name for name, _ in d.direction}) for d in self.seen.dropped]
        return {name: [dropped for dropped, carriers in parts if name in carriers] for name in self.seen.names}

    @property
    def effects(self) -> tuple[Array, Array]:
        """What one prior sigma of each parameter changes a reading by, rms and largest, (P,) [m]."""
        change = self.whole_rows * self.whole.prior
        return rms_sensitivity(change), abs(change).max(axis=(0, 1))


def compute_basis(cell: Cell, index: str, seed: int, say: Progress) -> StudyBasis:
    """Draw candidates, find what they see, and choose as many poses as the cell asks for or the curve suggests.

    Raises:
        NoSolutionError: a filter leaves fewer candidates than there are parameters.
    """
    count = min(CANDIDATES, cell.plan.candidates)
    pool = draw_candidates(cell, count, seed, lambda done, of: say("candidates", done, of))
    say("what is seen", 0, 0)
    model, seen, rows = identify_candidates(cell, pool)
    if len(pool) < 3 * seen.rank:
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left for {seen.rank} parameters: "
            "widen the cones, the cable's budget or the clearance"
        )
    whole = Model.from_cell(cell)
    curves = compute_index_curves(rows, model.prior, index, seed, say)
    poses = cell.plan.poses or find_curve(curves, index, scaled=False).knee
    chosen = exchange_poses(rows, min(max(poses, seen.rank), len(pool)), index, starts=2, seed=seed, steps=300).chosen
    noise = model.noise(pool.samples)
    return StudyBasis(
        cell=cell,
        index=index,
        seed=seed,
        pool=pool,
        whole=whole,
        whole_rows=whole.rows(pool.samples),
        model=model,
        rows=rows,
        seen=seen,
        curves=curves,
        poses=len(chosen),
        chosen=chosen,
        predicted=predict_covariance(rows[chosen], noise[chosen, None]),
        noise=float(np.median(noise)),
    )
