"""The result of identification: the document, and the parts of the fit that stay in memory."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from planner.cell.setup import MeasurementSetup
from planner.common.units import Array, to_deg
from planner.design.observability.identifiability import DroppedParameter
from planner.identification.least_squares import Fit
from planner.identification.released_robot import ReleasedRobot
from planner.model.identification_document import DetectionLimit, Finding, Identification, OnlyInMemory, RejectedEffect
from planner.runs.run import Run


@dataclass(frozen=True)
class TracingResult:
    """Result of tracing.

    Attributes:
        findings: effects in the model, in the order in which they were found.
        limits: for every effect that was looked for and not found.
        rejected: what was refitted and not kept.
        tried: number of effects and inner values that were looked at.
    """

    findings: tuple[Finding, ...] = ()
    limits: tuple[DetectionLimit, ...] = ()
    rejected: tuple[RejectedEffect, ...] = ()
    tried: int | None = None


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


class Calibration(Identification):
    """A robot identified from a run, with the run and the fit themselves, which the file does not hold.

    Attributes:
        run: what was measured.
        fit: the last stage's.
        dropped: parameters the data cannot see.
        covariance: of the fitted parameters, (P, P).
        diagnosis: every test of the last stage's residual.
        released: the robot that is written; the last stage's where it is ``None``.
    """

    run: Annotated[Run, OnlyInMemory] = Field(exclude=True)
    fit: Annotated[Fit, OnlyInMemory] = Field(exclude=True)
    dropped: Annotated[tuple[DroppedParameter, ...], OnlyInMemory] = Field(exclude=True)
    covariance: Annotated[Array, OnlyInMemory] = Field(exclude=True)
    diagnosis: Annotated[ResidualDiagnosis, OnlyInMemory] = Field(exclude=True)
    released: Annotated[ReleasedRobot | None, OnlyInMemory] = Field(default=None, exclude=True)

    @property
    def setup(self) -> MeasurementSetup:
        """The set-up that was fitted."""
        return self.fit.setup


def joint_zeros_text(c: Calibration) -> str:
    """Return the joint zeros [deg] with their standard deviations; empty where the run shows none.

    A controller's angle q turns the model by A q + θ₀, so errors of θ are A times errors of q. A joint that the run
    does not show, or that is coupled to such a joint, has none; one whose zero also stands for other errors bears a *.
    """
    robot = c.setup.robot
    names = [f"theta{k + 1}" for k in range(robot.n_joints)]
    seen = {e.name: e for e in c.estimates if e.identifiable}
    shift = np.array([seen[n].value - seen[n].nominal if n in seen else 0.0 for n in names])
    std = np.array([(seen[n].std or 0.0) if n in seen else 0.0 for n in names])
    turn = np.linalg.inv(robot.sense_matrix)
    zero, sigma = to_deg(turn @ shift), to_deg(np.sqrt(turn**2 @ std**2))
    shown = ((turn == 0.0) | np.array([n in seen for n in names])).all(axis=1)
    if not shown.any():
        return ""
    stars = ["*" if n in seen and seen[n].absorbs else "" for n in names]
    parts = [f"joint {k + 1} {zero[k]:+.3f} ± {sigma[k]:.3f}°{stars[k]}" for k in np.flatnonzero(shown)]
    unseen = ", ".join(str(k + 1) for k in np.flatnonzero(~shown))
    remarks = [
        "add it to the angle that is shown",
        "* also stands for errors that the run does not show" if any(stars) else "",
        f"not seen: joint {unseen}" if unseen else "",
    ]
    return f"{', '.join(parts)} ({'; '.join(filter(None, remarks))})"
