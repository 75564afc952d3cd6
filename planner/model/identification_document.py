"""``identification.json``: what an identification found, in SI units in memory, in mm and degrees in the file."""

from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, GetPydanticSchema
from pydantic_core.core_schema import any_schema

from planner.common.errors import InputError
from planner.common.files import document_text
from planner.common.schema import read_json, validate
from planner.common.units import Array, mean_by_group, to_mm
from planner.model.calibration_summary import CalibrationSummary
from planner.model.document_section import DocumentSection, Probability, Size, round_digits
from planner.model.finding import Finding, RejectedEffect
from planner.model.finding_groups import list_causes
from planner.model.gauge_frames import GaugeFrames, JointZero
from planner.model.misfit_place import MisfitPlace
from planner.model.more_poses import MorePoses
from planner.model.use_statement import Use

OnlyInMemory = GetPydanticSchema(lambda *_: any_schema())
"""Of a field that the file does not hold and pydantic does not look into."""
NO_RESIDUAL, NO_WEIGHT = np.empty((0, 0)), np.empty(0)


class Metrics(DocumentSection):
    """Root mean square, mean and largest error of some samples [m]; ``spread``: of the rms between the folds [m]."""

    if_any = ("spread_mm",)
    rms: Size
    mean: Size = 0.0
    largest: Size = 0.0
    spread: Size | None = None

    @classmethod
    def of(cls, residual: Array, fold: np.ndarray | None = None, weight: Array | None = None) -> "Metrics":
        """Judge residuals (n, r) [m]; a probe's orientation is left aside.

        Samples count by their ``weight`` (n,), if given; the largest error is of those that count by half or more.
        """
        size, weight = error_size(residual), np.ones(len(residual)) if weight is None else weight
        spread = None
        if fold is not None:
            share = mean_by_group(weight, fold)
            square = (mean_by_group(weight * size**2, fold) / np.maximum(share, 1e-300))[share > 0]
            spread = float(np.std(np.sqrt(square), ddof=1)) if len(square) > 1 else None
        return cls(
            rms=float(np.sqrt(np.average(size**2, weights=weight))),
            mean=float(np.average(size, weights=weight)),
            largest=float(size[weight >= 0.5 * weight.max()].max()),
            spread=spread,
        )


def error_size(residual: Array) -> Array:
    """Length of each sample's error (n,) [m] of residuals (n, r)."""
    return np.asarray(np.linalg.norm(residual[:, :3], axis=1))


class WithinGroups(DocumentSection):
    """The last stage's errors where single poses are held out, beside those of whole sessions, placements or blocks."""

    held_out: Metrics


class HoldOut(DocumentSection):
    """How samples were held out: in whole groups ``by`` pose, session …, the share ``hold_out`` of them at a time."""

    if_any = ("within",)
    by: str
    hold_out: float
    within: WithinGroups | None = None

    @property
    def groups(self) -> str:
        """Name of the groups, in the plural."""
        return "sections" if self.by == "stretch" else f"{self.by}s"


class Stage(DocumentSection):
    """One stage of the fit and its errors.

    Attributes:
        name: ``nominal``, ``frames``, ``geometry``, or the effect that was added.
        effects: all effects in the model at this stage.
        parameters: how many were fitted.
        train, held_out, validation: the errors; ``validation`` only where a second run was given.
        residual, held_residual: of every sample, (n, r) [m, rad]; not in the file.
        weight: by how much each sample counts, (n,); not in the file.
    """

    if_any = ("validation",)
    name: str
    effects: tuple[str, ...] = ()
    parameters: int = 0
    train: Metrics
    held_out: Metrics
    validation: Metrics | None = None
    residual: Annotated[Array, OnlyInMemory] = Field(default=NO_RESIDUAL, exclude=True)
    held_residual: Annotated[Array, OnlyInMemory] = Field(default=NO_RESIDUAL, exclude=True)
    weight: Annotated[Array, OnlyInMemory] = Field(default=NO_WEIGHT, exclude=True)

    def weigh(self, weight: Array, fold: np.ndarray) -> Self:
        """Return the stage whose errors, those held out in folds (n,), count samples by other weights (n,)."""
        if np.array_equal(weight, self.weight):
            return self
        train, held_out = Metrics.of(self.residual, weight=weight), Metrics.of(self.held_residual, fold, weight)
        return self.model_copy(update={"train": train, "held_out": held_out, "weight": weight})


class Estimate(DocumentSection):
    """One parameter, of the robot that is released or of the last stage's fit.

    An interval about ``value`` is ``std`` times Student's t at the document's ``degrees_of_freedom``.

    Attributes:
        name, unit, what: as in the model.
        value, nominal: of the elementary transform, the fixture, the reading, or a number inside an effect.
        std: standard deviation; ``None`` where nothing is known of the parameter.
        identifiable: whether the run shows it; what it does not show has its usual size for a standard deviation.
        absorbs: names of left-out parameters whose error it also carries.
        because: why it was left out.
        group: ``gauge``, ``geometry`` or the effect it belongs to.
    """

    in_unit = ("value", "nominal", "std")
    if_any = ("because",)
    name: str
    value: float
    nominal: float = 0.0
    std: float | None = None
    unit: str
    identifiable: bool = True
    absorbs: tuple[str, ...] = ()
    because: str | None = None
    what: str = ""
    group: str = ""


class DetectionLimit(DocumentSection):
    """The smallest size of an effect that was not found which this run would have shown in 95 of 100 cases."""

    in_unit = ("size",)
    effect: str
    on: str
    size: float
    unit: str


class Unexplained(DocumentSection):
    """What the model leaves on held-out samples, and along what it is not chance.

    ``rms`` [m] is all that is left, to be compared with the noise floor; ``structured_rms`` the part of it that follows
    what ``along`` names.
    """

    structured: bool = False
    along: tuple[str, ...] = ()
    rms: float = 0.0
    structured_rms: float = 0.0
    note: str = ""


class SizeOfFamily(DocumentSection):
    """How large effects of one family are: rms factor on the sizes that the catalogue expects.

    A number of the posterior, by which plans and fleets learn, and no cause: those are the findings. ``probability``:
    how likely it acts at all.
    """

    name: str
    factor: float
    probability: Probability = 1.0


class WorkToolError(DocumentSection):
    """Error to be expected over the workspace [m], rms, of a tool whose point [m] in the flange frame the cell names.

    ``nominal_anywhere`` is that of the robot before. Where the point sits in the true flange counts as known.
    """

    position: tuple[float, float, float]
    anywhere: Size
    nominal_anywhere: Size


class ErrorParts(DocumentSection):
    """Parts of the error over the workspace [m], rms; their squares add up to its square.

    Attributes:
        seen: by noise and the number of readings: more of the same make it less.
        unseen: what a hundred times as many readings at the same poses would leave: the gauge's scale, the tool's
            mount, postures that were not measured.
        misfit: what no named cause explains; drift: how far the arm moved in the run from what it was on average.
    """

    seen: Size
    unseen: Size
    misfit: Size
    drift: Size = 0.0


class UnseenError(DocumentSection):
    """Errors that no pose of the run has shown: what, what would show it, and what the error would then stay below [m].

    ``at_most`` is the 95 % limit over the workspace once all of it is known: the best that such poses can bring.
    """

    what: str
    cure: str
    at_most: Size

    def text(self, limit: float) -> str:
        """Say it in a sentence; ``limit`` is the limit as it is [m]."""
        before, after = (f"{float(to_mm(v)):.3f}" for v in (limit, self.at_most))
        return f"{self.what}: {self.cure} would show it, limit {before} → {after} mm at best"


ReleaseBasis = Literal["posterior", "geometry", "fit"]
"""What a released robot is made of: the mean over all that may be there, geometry alone, or the last stage."""


class Release(DocumentSection):
    """The calibrated robot that was written, and errors of the tool over the workspace [m], rms.

    Each is as likely exceeded as not.

    Attributes:
        basis: whether the robot holds effects by the posterior or geometry alone.
        share: how much of the way it goes from geometry alone to the robot with the least expected square of its error
            over that of geometry alone, 0 to 1: as far as it is hardly ever noticeably worse there.
        findings: those that entered the posterior; what they would do is left to the background of the others.
        held_out, validation: errors of this robot.
        at_most: what the released robot's error stays below with a probability of 95 %.
        nominal_anywhere, geometry_anywhere: of the robot before, and of geometry alone.
        other_tool: of a tool 200 mm about the flange that was not measured.
        where_measured: of the measured tool at poses of the run, the base aligned to these.
        work_tool: of the tool that the cell names.
        families: sizes of the effects as learnt.
        parts: of the released robot's error.
        warmth: lowest and highest temperature of the run [°C], where it was logged: for an arm as warm all this holds.
        not_shown: errors of base and joints that no pose has shown, those that leave most open first.
        misfit_place: where the part that is misfit is largest, where the run shows any, and what acts like it.
        unexplained: motion of the tool that the run shows and no named cause explains.
    """

    if_any = (
        "validation", "work_tool", "parts", "misfit_place", "unexplained", "where_measured_mm", "temperature_degC"
    )  # fmt: skip
    basis: Literal["posterior", "geometry"]
    share: Probability = 1.0
    findings: tuple[str, ...] = ()
    held_out: Metrics
    validation: Metrics | None = None
    at_most: Size
    nominal_anywhere: Size
    geometry_anywhere: Size
    other_tool: Size
    where_measured: Size | None = None
    work_tool: WorkToolError | None = None
    families: tuple[SizeOfFamily, ...] = ()
    parts: ErrorParts | None = None
    warmth: tuple[float, float] | None = None
    not_shown: tuple[UnseenError, ...] = ()
    misfit_place: MisfitPlace | None = None
    unexplained: MisfitPlace | None = None

    @property
    def warmth_text(self) -> str:
        """Say for which warmth of the arm the errors are stated."""
        logged = "" if self.warmth is None else f" ({self.warmth[0]:.1f} to {self.warmth[1]:.1f} °C)"
        return f"for an arm as warm as in this run{logged}; what a warmer or colder one is off is not stated"


class Identification(DocumentSection):
    """A robot identified from a run.

    Attributes:
        n_samples, n_groups: of the run, and the groups that are held out together; ``n_validation``: samples that took
            no part in any fit.
        stages: in order.
        estimates: every parameter of the robot that is released, seen or not, as it is written.
        fitted: those that the last stage fitted, as that fit has them: what its findings and residuals belong to, and
            no robot. Empty where the last stage itself is released, and in files written before there was a difference.
        joint_zeros: what the controller's zeros of the released robot's joints are off, of joints that the run shows.
        degrees_of_freedom: readings, correlated ones counted as fewer, less the parameters that they decide.
        findings: the causes that the run shows, each with its probability and its rivals: those that tracing found and
            those that the posterior holds besides, many of one kind as one, in the order of what each takes away.
        limits: for every effect that was looked for and not found.
        rejected: what was tried in full and not kept, or what the posterior speaks against.
        tried: number of effects and inner values that tracing looked at; ``None`` where nothing was traced.
        noise_floor: standard deviation of repeated readings [m], or ``None`` without repeats.
        workspace_error: error of the released robot's tool over the workspace [m], rms, as likely exceeded as not.
        release: what the robot's file holds and how good it is expected to be.
        condition_number: of the rows per prior sigma; ``None`` where it is not finite.
        correlation_time: how many samples are worth one.
        worse_than_nominal: in what the robot that was fitted is worse than the nominal one; ``None`` where in nothing.
        use: whether the robot is good enough for a tolerance, where one was asked for.
        more: what more poses would bring, of a bar or a wire.
        summary: what screen and page say first.
        problems: reasons not to use the result; empty when the fit passed its own checks.
        warnings: what a person should know.
        simulated: true where a run was simulated, else ``None``: nobody measured this robot.
        angle_unit: of errors of readings where the gauge reads an angle, whatever their keys say; ``None`` where
            they are in mm, as those of the tool always are.
    """

    if_any = (
        "release", "n_validation", "simulated", "worse_than_nominal", "use", "more", "summary", "angle_unit",
    )  # fmt: skip
    schema_: Literal["edbb-identification/1"]
    worse_than_nominal: str | None = None
    robot: str
    n_samples: int = Field(gt=0)
    n_groups: int = 0
    n_validation: int | None = None
    split: HoldOut = HoldOut(by="pose", hold_out=0.2)
    stages: tuple[Stage, ...] = Field(min_length=1)
    estimates: tuple[Estimate, ...]
    fitted: tuple[Estimate, ...] = ()
    joint_zeros: tuple[JointZero, ...] = ()
    degrees_of_freedom: float = Field(ge=1)
    findings: Annotated[tuple[Finding, ...], AfterValidator(list_causes)]
    limits: tuple[DetectionLimit, ...] = ()
    rejected: tuple[RejectedEffect, ...] = ()
    tried: int | None = None
    unexplained: Unexplained = Unexplained()
    noise_floor: float | None = None
    workspace_error: Size = 0.0
    release: Release | None = None
    condition_number: float | None = None
    correlation_time: float = Field(default=1.0, gt=0)
    frames: GaugeFrames = GaugeFrames()
    use: Use | None = None
    more: MorePoses | None = None
    summary: CalibrationSummary | None = None
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    simulated: Literal[True] | None = None
    angle_unit: Literal["mrad"] | None = None

    @property
    def reading_unit(self) -> str:
        """What a thousandth of a reading is called: mm, or mrad where it is an angle."""
        return self.angle_unit or "mm"

    @property
    def placed_stage(self) -> Stage:
        """The robot as its data sheet has it, only the gauge placed on it: what "before" means of readings."""
        return next((s for s in self.stages if s.name == "frames"), self.stages[0])

    @property
    def reason_not_to_use(self) -> str:
        """Why nothing may be made of this robot: its fit failed, or it is worse than the nominal one; else empty."""
        return "; ".join(dict.fromkeys((*self.problems, *filter(None, [self.worse_than_nominal]))))

    @property
    def refusal(self) -> str:
        """The first reason not to use this robot, without what is to be looked for; empty where it may be used."""
        return self.reason_not_to_use.partition("; ")[0]

    @property
    def last_fit(self) -> tuple[Estimate, ...]:
        """Return what the last stage fitted, with the standard deviations of that fit alone."""
        return self.fitted or tuple(e for e in self.estimates if e.identifiable)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read ``identification.json``.

        Raises:
            InputError: with the first offending keys, what was found and what is allowed.
        """
        return validate(read_json(path), cls, str(path))

    @classmethod
    def read_usable(cls, path: Path) -> Self:
        """Read ``identification.json`` of a robot that something is to be made of.

        Raises:
            InputError: as :meth:`read`, or it says that its robot is not to be used.
        """
        found = cls.read(path)
        if found.reason_not_to_use:
            raise InputError(f"{path}: this robot is not to be used, it says: {found.reason_not_to_use}; measure again")
        return found

    def content(self) -> dict[str, object]:
        """Return what the file says, in the contract's keys and units."""
        out = round_digits(self.model_dump(mode="json", by_alias=True))
        assert isinstance(out, dict)
        return out

    def to_json(self) -> str:
        """Return the text of ``identification.json``; the same calibration gives the same bytes."""
        return document_text(self.content())
