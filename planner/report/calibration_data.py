"""The numbers of the report, prepared once: errors before and after, and what they are drawn against."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array, mean_by_group, to_deg, to_mm
from planner.documents.calibration import Calibration
from planner.documents.calibration_summary import cause_lines, summarize
from planner.effects.compliance import LEAST_LOAD
from planner.effects.context import Context
from planner.kinematics.geometry import bar_state
from planner.model.calibration_summary import CalibrationSummary, CauseLine
from planner.model.identification_document import Release, Stage, error_size
from planner.model.model import chunks

PANEL_POINTS = 500  # of the samples, drawn in one panel


@dataclass(frozen=True)
class PlotVariable:
    """What residuals are drawn against: a quantity of the samples looked at, (m,) in the unit of ``label``."""

    kind: str
    label: str
    values: Array


@dataclass(frozen=True)
class CalibrationFacts:
    """A calibration with all that the report works out of it."""

    calibration: Calibration

    @property
    def placed_stage(self) -> Stage:
        """The robot as its data sheet has it, only the gauge placed on it."""
        return self.calibration.placed_stage

    @cached_property
    def written_stage(self) -> Stage:
        """The robot as it is written."""
        return self.calibration.written_stage

    @property
    def written_errors(self) -> Stage | Release:
        """Its errors held out and on the validation run, those of a run too long to keep each residual of as well."""
        return self.written_stage if self.calibration.release is None else self.calibration.release

    @cached_property
    def chart_samples(self) -> np.ndarray:
        """Samples that are looked at, evenly over the run, (m,) int: the same ones every time."""
        return even_positions(len(self.calibration.run), 20_000)  # samples of a long run that means are taken over

    @cached_property
    def few_rows(self) -> tuple[np.ndarray, Array]:
        """Samples that effects are drawn from, (m,) int, and the model's rows there without orientation, (m, r, P)."""
        # 1_500: samples that single effects are drawn from
        fit, which = self.calibration.fit, even_positions(len(self.calibration.run), 1_500)
        return which, fit.model.rows(self.calibration.run.samples.take(which), fit.errors)[:, :3]

    @cached_property
    def moves(self) -> Array:
        """How far the error of each fitted parameter moves the reading, (P,) [m], rms over the samples looked at.

        Errors are those of the robot as it is written; 0 for an effect that it does not hold.
        """
        fit, samples = self.calibration.fit, self.calibration.run.samples.take(self.chart_samples)
        error = {e.name: e.value - e.nominal for e in self.calibration.estimates}
        square = np.zeros(len(fit.errors))
        for part in chunks(len(samples), 512):  # the rows of all would be most of what a report takes
            rows = fit.model.rows(samples.take(part), fit.errors)[:, :3]
            square += np.einsum("nrp,nrp->p", rows, rows)
        return np.abs([error.get(n, 0.0) for n in fit.model.names]) * np.sqrt(square / len(samples))

    @cached_property
    def summary(self) -> CalibrationSummary:
        """What the page says first, as the document has it."""
        return self.calibration.summary or summarize(self.calibration)

    @cached_property
    def causes(self) -> tuple[CauseLine, ...]:
        """Why the robot erred, all of it: the first of them are the summary's."""
        return tuple(cause_lines(self.calibration, self.summary.targets_within_before))

    @cached_property
    def correlation(self) -> Array:
        """Correlations of the fitted parameters, (P, P)."""
        C = self.calibration.covariance
        size = np.sqrt(np.diag(C))
        return np.asarray(np.clip(C / np.outer(size, size), -1.0, 1.0))

    @cached_property
    def plot_variables(self) -> tuple[PlotVariable, ...]:
        """Everything that the run has to draw residuals against."""
        return tuple(a for a in (*self._angles(), *self._gauge(), *self._circumstances()) if np.ptp(a.values) > 0)

    def _angles(self) -> list[PlotVariable]:
        samples = self.calibration.run.samples.take(self.chart_samples)
        units = self.calibration.setup.robot.joint_units
        out = [PlotVariable("joints", f"joint {j + 1} ({units[j]})", q) for j, q in enumerate(to_deg(samples.q).T)]
        setup = self.calibration.setup
        if setup.weighs or samples.force is not None or samples.payload is not None:
            load = Context(setup, samples).load_torque
            borne = [(j, t) for j, t in enumerate(load.T) if np.abs(t).max(initial=0.0) > LEAST_LOAD]
            out += [PlotVariable("loads", f"load on joint {j + 1} (Nm)", t) for j, t in borne]
        if samples.torque is not None:
            out += [PlotVariable("loads", f"measured torque {j + 1} (Nm)", t) for j, t in enumerate(samples.torque.T)]
        return out

    def _gauge(self) -> list[PlotVariable]:
        c, which = self.calibration, self.chart_samples
        setup, samples = c.setup, c.run.samples.take(which)
        if c.run.readings.length is None:
            p = setup.targets(samples, c.run.readings.take(which)).position
            if p is None:
                p = setup.chain.forward(setup.robot.theta(samples.q), setup.offsets(samples)).x.T
            return [PlotVariable("gauge", f"position {'xyz'[k]} (mm)", to_mm(v)) for k, v in enumerate(p.T)]
        motion = setup.chain.forward(setup.robot.theta(samples.q), setup.offsets(samples))
        bar, noun = bar_state(motion.x.T, setup.p_BX[samples.place]), setup.gauge.noun
        x, y, z = bar.direction.T
        return [
            PlotVariable("gauge", "length read (mm)", to_mm(c.run.readings.length[which])),
            PlotVariable("gauge", f"direction of the {noun} about z (deg)", to_deg(np.arctan2(y, x))),
            PlotVariable("gauge", f"elevation of the {noun} (deg)", to_deg(np.arcsin(np.clip(z, -1.0, 1.0)))),
        ]

    def _circumstances(self) -> list[PlotVariable]:
        s = self.calibration.run.samples.take(self.chart_samples)
        logged = {"time (s)": s.t, "temperature (°C)": s.temperature, "force (N)": s.force, "payload (kg)": s.payload}
        return [PlotVariable("circumstances", label, v) for label, v in logged.items() if v is not None]


def error_along(residual: Array) -> Array:
    """Signed errors (n,) [m] of residuals (n, r): of lengths, or of positions along where they vary most."""
    error = residual[:, :3]
    if error.shape[1] == 1:
        return error[:, 0]
    axis = np.linalg.eigh(error.T @ error)[1][:, -1]
    return np.asarray(error @ (axis * np.sign(axis[np.argmax(np.abs(axis))])))


def error_by_pose(told: CalibrationFacts) -> tuple[tuple[str, ...], Array, Array]:
    """Names and held-out errors [m] before and after, of the poses at rest or of samples along a continuous run."""
    shown_poses = 1500  # that are drawn one by one
    run = told.calibration.run
    before, after = error_size(told.placed_stage.held_residual), error_size(told.written_stage.held_residual)
    if run.continuous or run.samples.pose is None:
        which = even_positions(len(run), shown_poses)
        return tuple(f"sample {k + 1}" for k in which), before[which], after[which]
    pose, first = np.unique(run.samples.pose, return_index=True)
    pose = pose[np.argsort(first)]
    place = np.argsort(pose)[np.searchsorted(np.sort(pose), run.samples.pose)]
    few = even_positions(len(pose), shown_poses)
    was, left = (np.sqrt(mean_by_group(size**2, place))[few] for size in (before, after))
    return tuple(f"pose {p}" for p in pose[few]), was, left
