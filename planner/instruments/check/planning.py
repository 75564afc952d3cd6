"""The session of a check: a few poses at rest, chosen to tell whether and where something has changed."""

from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import cell_of
from planner.common.determinism import Positions
from planner.common.progress import Stages
from planner.common.units import Array
from planner.design.observability.identifiability import find_identifiable
from planner.design.observability.information import all_indices, index_value
from planner.design.pose_selection import PoseChoice
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_curves import BackgroundCurve
from planner.identification.baseline import Baseline
from planner.instruments.check.changes import Change, possible_changes
from planner.instruments.check.selection import choose_check_poses
from planner.model.model import Model
from planner.session.bar_poses import BarPoses
from planner.session.options import PlanOptions
from planner.session.planning import Selection

CANDIDATES = 3000  # a check asks less of its pool than a calibration does


def resting_cell(cell: Cell) -> Cell:
    """Return the cell for a check: at rest at every pose, none repeated and none kept aside.

    Raises:
        InputError: its gauge is no bar without load.
    """
    cell.require_bar(
        "a check is measured with a bar without load (of a tracker's run 'edbb accuracy' says how far it is off)",
        free=True,
    )
    plan = cell.file.plan.model_copy(update={"repeat": 0, "validate_": 0, "candidates": CANDIDATES, "refine": False})
    motion = cell.file.motion.model_copy(update={"measure": "static"})
    return cell_of(cell.file.model_copy(update={"plan": plan, "motion": motion}), cell.path, cell.name)


class CheckPoses(BarPoses):
    """Where the poses of a check come from: ``count`` of them, chosen against a baseline."""

    def __init__(self, cell: Cell, options: PlanOptions, baseline: Baseline, count: int) -> None:
        super().__init__(resting_cell(cell), options)
        self.baseline, self.count = baseline, count

    def select(self, stages: Stages) -> Selection:
        """Choose the poses by what they tell of changes; the index over the axes' zeros only judges them."""
        with stages.stage("selection"):
            baseline = self.baseline.for_samples(self.pool.samples)
            changes = possible_changes(self.cell, baseline.model.setup, with_play=False)
            chosen = choose_check_poses(baseline, changes, self.pool.samples, self.count)
            choice, rows = self._judge_by_index(baseline, changes, chosen)
        self.notes.append(f"the poses tell changes since the calibration; {self.index} of the axes' zeros judges them")
        sizes = [n for n in (self.count, 2 * self.count, 3 * self.count) if rows.shape[2] < n <= len(self.pool)]
        return Selection(choice, BackgroundCurve(rows, sizes, self.index, self.options.seed, choice.certificate))

    def _judge_by_index(
        self, baseline: Baseline, changes: tuple[Change, ...], chosen: Positions
    ) -> tuple[PoseChoice, Array]:
        """Return the chosen poses with their index on the axes' zeros, and the rows of all candidates."""
        samples, size = self.pool.samples, self.cell.robot.priors.angle
        zeros = (replace(p, name=c.name, prior=size) for c in changes if c.kind == "zero" for p in c.parameters)
        model = Model(baseline.model.setup, tuple(zeros))
        rows, noise = model.rows(samples), float(np.median(model.noise(samples)))
        seen = find_identifiable(rows, model.names, model.prior, noise=noise)
        kept = list(seen.kept)
        model, rows = model.subset(kept), np.ascontiguousarray(rows[:, :, kept])
        certificate = certify_bound(rows, self.index, self.count)
        there = samples.take(chosen)
        final = model.rows(there)
        value = index_value(self.index, final)
        indices = all_indices(final), all_indices(final, model.prior)
        return PoseChoice(model, seen, there, chosen, self.index, value, value, certificate, *indices), rows
