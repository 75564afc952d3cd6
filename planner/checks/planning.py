"""The session of a check: a few poses at rest, chosen to tell whether and where something has changed."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from planner.cell.cell import Cell
from planner.cell.reading import cell_of
from planner.checks.evaluation import Change, build_detector, change_columns, possible_changes
from planner.checks.words import CHECK_NOTE
from planner.common.determinism import Positions, even_positions
from planner.common.errors import InputError
from planner.common.progress import Stages, TimeLimit
from planner.common.units import Array
from planner.design.observability.identifiability import find_identifiable
from planner.design.pose_selection import PoseChoice
from planner.design.selection.index_bound import certify_bound
from planner.documents.baseline import Baseline
from planner.model.model import Model
from planner.runs.run import Samples
from planner.session.planning import PoseSession, Selection

COMPETING_CANDIDATES = 500  # evenly spread over the pool


def choose_check_poses(baseline: Baseline, changes: tuple[Change, ...], pool: Samples, count: int) -> Positions:
    """Return the positions of ``count`` candidates, by exchange from a start by pivoting.

    The figure of merit is the mean over all changes of log λ, with λ the information about the direction that shows
    least per motion of the tool (E-optimal for each change: its detectable size is as 1/√λ), plus the logarithm of the
    determinant of the correlation of the axes' zeros, per axis (D-optimal: says which of them it was).
    """
    tried = even_positions(len(pool), COMPETING_CANDIDATES)
    samples = pool.take(tried)
    merit = _Merit.of(baseline, changes, samples)
    white = merit.columns / np.sqrt(np.diag(merit.covariance))[:, None]
    chosen = list(dict.fromkeys(qr(white.T, pivoting=True, mode="r")[1] // baseline.model.width))[:count]
    for at in range(count - len(chosen)):  # fewer columns than poses
        chosen.append(next(k for k in range(at, len(tried)) if k not in chosen))
    best = float(merit.of_sets(np.array([chosen]))[0])
    for _ in range(4):  # passes of exchanges
        before = best
        for place in range(count):
            others = np.setdiff1d(np.arange(len(tried)), chosen)
            sets = np.repeat(np.array([chosen]), len(others), axis=0)
            sets[:, place] = others
            values = merit.of_sets(sets)
            k = int(np.argmax(values))
            if values[k] > best:
                best, chosen[place] = float(values[k]), int(others[k])
        if best == before:
            break
    return np.sort(tried[chosen])


@dataclass(frozen=True)
class _Merit:
    """Figure of merit of sets of candidates.

    ``width`` numbers of a reading; ``covariance`` (N r, N r) of their readings; ``columns`` (N r, D) of all changes per
    metre of the tool's motion; ``blocks`` where each change has its columns; ``zeros`` (z,) columns of the axes' zeros.
    """

    width: int
    covariance: Array
    columns: Array
    blocks: tuple[slice, ...]
    zeros: np.ndarray

    @classmethod
    def of(cls, baseline: Baseline, changes: tuple[Change, ...], samples: Samples) -> "_Merit":
        """Return the merit of samples for telling each change, from which poses are chosen."""
        parts, blocks, zeros, start = [], [], [], 0
        alone = [c for c in changes if c.kind != "collision"]  # which is nothing but the others together
        for c, rows in zip(alone, change_columns(baseline, samples, alone), strict=True):
            root = np.linalg.cholesky(c.square + 1e-15 * np.trace(c.square) * np.eye(len(c.square)))
            parts.append(np.linalg.solve(root, rows.T).T)
            blocks.append(slice(start, start + len(c.parameters)))
            zeros += [start] if c.kind == "zero" else []
            start += len(c.parameters)
        anew = baseline.anew_rows(samples)
        covariance = baseline.covariance(samples) + anew @ anew.T
        return cls(baseline.model.width, covariance, np.hstack(parts), tuple(blocks), np.array(zeros))

    def of_sets(self, sets: np.ndarray) -> Array:
        """Return the merit (m,) of sets (m, n) of positions of poses."""
        sets = (sets[:, :, None] * self.width + np.arange(self.width)).reshape(len(sets), -1)
        covariance = self.covariance[sets[:, :, None], sets[:, None, :]]
        columns = self.columns[sets]
        information = columns.transpose(0, 2, 1) @ np.linalg.solve(covariance, columns)
        least = [np.linalg.eigvalsh(information[:, b, b])[:, 0] for b in self.blocks]
        z = information[:, self.zeros[:, None], self.zeros]
        unit = np.sqrt(np.einsum("mii->mi", z))
        sign, size = np.linalg.slogdet(z / (unit[:, :, None] * unit[:, None, :] + 1e-300))
        apart = np.where(sign > 0, size, -np.inf) / len(self.zeros)
        return np.asarray(np.log(np.maximum(np.stack(least), 1e-300)).mean(axis=0) + apart)


def resting_cell(cell: Cell) -> Cell:
    """Return the cell for a check: at rest at every pose, none repeated and none kept aside.

    Raises:
        InputError: a bar pulls there, or circles are driven.
    """
    candidates = 3000  # a check asks less of its pool than a calibration does
    if cell.is_under_load:
        raise InputError(
            f"{cell.path}: a check is measured at rest and without load: take the cell of a bar without load"
        )
    plan = cell.file.plan.model_copy(update={"repeat": 0, "validate_": 0, "candidates": candidates, "refine": False})
    motion = cell.file.motion.model_copy(update={"measure": "static"})
    return cell_of(cell.file.model_copy(update={"plan": plan, "motion": motion}), cell.path, cell.name)


@dataclass(frozen=True)
class CheckChooser:
    """Chooses the poses of a check: ``count`` of them, against a baseline."""

    baseline: Baseline
    count: int

    def __call__(self, session: PoseSession, stages: Stages) -> Selection:
        """Choose the poses by what they tell of changes; the index over the axes' zeros only judges them."""
        pool = session.pool.samples
        with stages.stage("selection"):
            baseline = self.baseline.restrict_to_samples(pool)
            changes = possible_changes(session.cell, baseline.model.setup, with_play=False)
            changes = build_detector(baseline, changes, pool.take(even_positions(len(pool), COMPETING_CANDIDATES)))[1]
            chosen = choose_check_poses(baseline, changes, pool, self.count)
            choice = _judge_by_index(session, baseline, changes, chosen, stages.limit)
        session.notes.append(CHECK_NOTE)
        return Selection(choice)


def _judge_by_index(
    session: PoseSession, baseline: Baseline, changes: tuple[Change, ...], chosen: Positions, limit: TimeLimit
) -> PoseChoice:
    """Return the chosen poses with their index on the axes' zeros."""
    samples, size, index = session.pool.samples, session.cell.robot.priors.angle, session.index
    zeros = (replace(p, name=c.name, prior=size) for c in changes if c.kind == "zero" for p in c.parameters)
    model = Model(baseline.model.setup, tuple(zeros))
    rows, noise = model.rows(samples), float(np.median(model.noise(samples)))
    seen = find_identifiable(rows, model.names, model.prior, noise=noise)
    kept = list(seen.kept)
    model, rows = model.subset(kept), np.ascontiguousarray(rows[:, :, kept])
    certificate = certify_bound(rows, index, len(chosen), limit=limit)
    return PoseChoice.of_candidates(session.pool, chosen, model, seen, certificate)
