"""The result of identification: the document, and the parts of the fit that stay in memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from planner.cell.cell import MeasurementSetup
from planner.common.units import Array, to_deg
from planner.design.observability.identifiability import DroppedParameter
from planner.fit.assumptions import COUNTED
from planner.fit.axis_zeros import AxisZeros
from planner.fit.least_squares import Fit
from planner.kinematics.robot import Robot
from planner.model.gauge_frames import JointZero
from planner.model.identification_document import NO_WEIGHT, Estimate, Identification, OnlyInMemory, Stage
from planner.model.use_statement import Use
from planner.programs.controller_axes import controller_words
from planner.release.released_robot import ReleasedRobot
from planner.runs.run import Run


@dataclass(frozen=True)
class ResidualTest:
    """One test: quantity, probability of chance after Bonferroni, rms that follows the quantity [m]."""

    along: str
    p_value: float
    rms: float


@dataclass(frozen=True)
class ResidualDiagnosis:
    """Result of all tests of the last stage's residual.

    Attributes:
        trials: all of them, in order; empty where the run is too small.
        found: those that are not chance, the largest first.
        rms: of what follows all of ``found`` together [m].
        sentence: the same in words.
    """

    trials: tuple[ResidualTest, ...]
    found: tuple[ResidualTest, ...]
    rms: float
    sentence: str

    @property
    def structured(self) -> bool:
        """Whether the residual is not chance."""
        return bool(self.found)


class PlannedTargets(NamedTuple):
    """What the plan of a run expected: 95 of 100 targets ``within`` so much, 95 % sure [m], after so many ``poses``."""

    within: float
    poses: int


class Calibration(Identification):
    """A robot identified from a run, with the run and the fit themselves, which the file does not hold.

    Attributes:
        run: what was measured.
        fit: the last stage's.
        dropped: parameters the data cannot see.
        covariance: of the fitted parameters, (P, P).
        diagnosis: every test of the last stage's residual.
        released: the robot that is written; the last stage's where it is ``None``.
        other_zeros: the joint zeros in the axes of the cell's other controllers, where these count otherwise.
        planned_errors: what the plan of each session has foreseen after each pose [m], empty where that is not known.
        planned_targets: what the one plan expected of the robot's targets; ``None`` where that is not known.
        good_for: what the released robot is good for, whether or not a tolerance was asked for.
        asides: those of the warnings that ask nothing of anybody.
        doubts: those that make the verdict doubtful.
        row_weight: by how much each sample of the run counts, (n,).
    """

    run: Annotated[Run, OnlyInMemory] = Field(exclude=True)
    fit: Annotated[Fit, OnlyInMemory] = Field(exclude=True)
    dropped: Annotated[tuple[DroppedParameter, ...], OnlyInMemory] = Field(exclude=True)
    covariance: Annotated[Array, OnlyInMemory] = Field(exclude=True)
    diagnosis: Annotated[ResidualDiagnosis, OnlyInMemory] = Field(exclude=True)
    released: Annotated[ReleasedRobot | None, OnlyInMemory] = Field(default=None, exclude=True)
    other_zeros: Annotated[tuple[JointZero, ...], OnlyInMemory] = Field(default=(), exclude=True)
    planned_errors: Annotated[tuple[tuple[float, ...], ...], OnlyInMemory] = Field(default=(), exclude=True)
    planned_targets: Annotated[PlannedTargets | None, OnlyInMemory] = Field(default=None, exclude=True)
    good_for: Annotated[Use | None, OnlyInMemory] = Field(default=None, exclude=True)
    asides: Annotated[frozenset[str], OnlyInMemory] = Field(default=frozenset(), exclude=True)
    doubts: Annotated[tuple[str, ...], OnlyInMemory] = Field(default=(), exclude=True)
    row_weight: Annotated[Array, OnlyInMemory] = Field(default=NO_WEIGHT, exclude=True)

    @property
    def outliers(self) -> np.ndarray:
        """Samples that stand outside the noise and count for little, (m,) int."""
        return np.flatnonzero(self.row_weight < COUNTED)

    @property
    def written_stage(self) -> Stage:
        """The robot as it is written; the last stage of a run so long that the written robot saw a part of it."""
        last, robot = self.stages[-1], self.released
        if robot is None or len(robot.held_residual) < len(self.run):
            return last
        update = {"held_out": robot.held_out, "validation": robot.validation, "held_residual": robot.held_residual}
        return last.model_copy(update=update | {"name": "calibrated"})

    def __repr__(self) -> str:
        """Name run and robot: what was fitted is long."""
        return f"Calibration('{self.run.name}', robot='{self.robot}', samples={self.n_samples})"

    @property
    def setup(self) -> MeasurementSetup:
        """The set-up that was fitted."""
        return self.fit.setup


ZEROS_OR_MODEL = "set these zeros in the controller, or correct programs by robot.toml, not both"
OWN_ANGLES = "add it to the angle of the model, which the controller may count in another sense"


def find_joint_zeros(
    robot: Robot, estimates: Sequence[Estimate], controller: str | None = None
) -> tuple[JointZero, ...]:
    """Return by how much the zeros of the controller's axes are off, from the values of the robot's parameters.

    ``controller``: name of its language, where it is not the one of the robot's maker.
    An axis that the run does not show, or that counts with a joint that it does not show, has none.
    """
    names = robot.zero_names
    seen = {e.name: e for e in estimates if e.identifiable}
    shift = np.array([seen[n].value - seen[n].nominal if n in seen else 0.0 for n in names])
    std = np.array([(seen[n].std or 0.0) if n in seen else 0.0 for n in names])
    axes = AxisZeros.of(robot, controller)
    turn = axes.turn
    zero, sigma = turn @ shift, np.sqrt(turn**2 @ std**2)
    shown = ((turn == 0.0) | np.array([n in seen for n in names])).all(axis=1)
    return tuple(
        JointZero(
            joint=int(k) + 1,
            axes_of=axes.controller or None,
            offset=float(zero[k]),
            offset_std=float(sigma[k]),
            absorbs=seen[names[k]].absorbs if names[k] in seen else (),
            slides=bool(robot.slides[int(np.abs(turn[k]).argmax())]) or None,
        )
        for k in np.flatnonzero(shown)
    )


def find_other_zeros(robot: Robot, estimates: Sequence[Estimate], dialects: Sequence[str]) -> tuple[JointZero, ...]:
    """Return the zeros in the axes of each controller of a cell that counts otherwise than the maker's."""
    described = {c.controller for c in robot.conventions}
    named = dict.fromkeys(name.partition("+")[0] for name in dialects)
    own = AxisZeros.of(robot).turn
    others = [n for n in named if n in described and not np.array_equal(AxisZeros.of(robot, n).turn, own)]
    return tuple(zero for name in others for zero in find_joint_zeros(robot, estimates, name))


def joint_zeros_text(c: Calibration) -> str:
    """Return the joint zeros [deg] in one sentence with all that is said of them; empty where the run shows none."""
    values, remarks = zeros_text(c)
    return f"{values} ({'; '.join(remarks)}){''.join(f'; {text}' for text in other_zeros_text(c))}" if values else ""


def zeros_text(c: Calibration) -> tuple[str, tuple[str, ...]]:
    """Return the joint zeros [deg] with their standard deviations, and what to know of them; empty where none is shown.

    One whose zero also stands for other errors bears a *. The decimals are those of the standard deviation.
    """
    if not c.joint_zeros:
        return "", ()
    shown = {z.joint for z in c.joint_zeros}
    unseen = ", ".join(str(k) for k in range(1, c.setup.robot.n_joints + 1) if k not in shown)
    axes = c.joint_zeros[0].axes_of
    remarks = [
        f"in the axes of {controller_words(axes)}: add it to the angle that this controller shows"
        if axes
        else OWN_ANGLES,
        "* also stands for errors that the run does not show" if any(z.absorbs for z in c.joint_zeros) else "",
        f"not seen: joint {unseen}" if unseen else "",
        ZEROS_OR_MODEL,
    ]
    return _zero_list(c.joint_zeros), tuple(filter(None, remarks))


def other_zeros_text(c: Calibration) -> list[str]:
    """Return the same zeros in the axes of each controller of the cell that counts otherwise."""
    return [
        f"in the axes of {controller_words(name)} instead: {_zero_list(zeros)}"
        for name in dict.fromkeys(z.axes_of or "" for z in c.other_zeros)
        if (zeros := [z for z in c.other_zeros if z.axes_of == name])
    ]


def _zero_list(zeros: Sequence[JointZero]) -> str:
    return ", ".join(
        f"joint {z.joint} {_degrees(z.offset, z.offset_std, '+')} ± {_degrees(z.offset_std, z.offset_std)}{z.unit}"
        f"{'*' if z.absorbs else ''}"
        for z in zeros
    )


def _degrees(value: float, std: float, sign: str = "") -> str:
    """Write an angle [rad] in degrees, with two digits of its standard deviation; never as minus zero."""
    size = float(to_deg(std))
    decimals = 3 if size <= 0 else int(np.clip(1 - np.floor(np.log10(size)), 1, 6))  # decimals of a degree
    return f"{round(float(to_deg(value)), decimals) + 0.0:{sign}.{decimals}f}"
