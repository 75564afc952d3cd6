"""What ``identification.json`` may hold: the contract's keys in mm and degrees, checked on the way out and in."""

from typing import Literal

from pydantic import Field

from planner.schema import Strict

SCHEMA = "edbb-identification/1"
Position = tuple[float, float, float]


class SplitSection(Strict):
    """How poses were held out: whole groups of this kind, and the share of them that each fit leaves out."""

    by: str
    hold_out: float
    within: "WithinSection | None" = None


class WithinSection(Strict):
    """The last stage's errors where single poses are held out, beside those of whole sessions, placements or blocks."""

    by: Literal["pose"] = "pose"
    held_out: "MetricsSection"


class MetricsSection(Strict):
    """Errors of a set of samples; ``spread_mm`` of the rms over the folds."""

    rms_mm: float
    mean_mm: float
    max_mm: float
    spread_mm: float | None = None


class StageSection(Strict):
    """One stage of the fit."""

    name: str
    effects: tuple[str, ...]
    parameters: int
    train: MetricsSection
    held_out: MetricsSection
    validation: MetricsSection | None = None


class ParameterSection(Strict):
    """One parameter in its ``unit`` (mm, deg, urad/Nm); ``because`` says why it was left out.

    An interval about ``value`` is ``std`` times Student's t at the file's ``degrees_of_freedom``.
    """

    name: str
    value: float
    nominal: float
    std: float | None
    unit: str
    identifiable: bool
    absorbs: tuple[str, ...]
    because: str | None = None
    what: str
    group: str


class InnerSection(Strict):
    """The number inside an effect: a frequency, a time constant, a width."""

    name: str
    value: float
    std: float | None
    unit: str


class FindingSection(Strict):
    """An effect that was found in the residual; its parameters are those of the group ``effect, on``.

    ``value`` is the length of the vector of its parameters. ``p_value`` is corrected for everything that was tried;
    ``log10_p`` is its logarithm, which runs out of digits later (then it is null). ``held_out_gain`` [mm] is the fall
    of the rms on held-out samples in the stage that brought the effect.
    """

    effect: str
    on: str
    value: float
    std: float
    unit: str
    p_value: float
    log10_p: float | None
    held_out_gain: float
    rivals: tuple[str, ...]
    note: str
    inner: InnerSection | None = None


class LimitSection(Strict):
    """The smallest size of an effect that was not found which this run would have shown in 95 of 100 cases."""

    effect: str
    on: str
    size: float
    unit: str


class RejectedSection(Strict):
    """An effect that was tried in full and not kept."""

    name: str
    because: str


class UnexplainedSection(Strict):
    """What the model leaves on held-out samples, and along what it is not chance.

    ``rms_mm`` is all that is left, to be compared with the noise floor; ``structured_rms_mm`` the part of it that
    follows what ``along`` names.
    """

    structured: bool
    along: tuple[str, ...]
    rms_mm: float
    structured_rms_mm: float
    note: str


class FixtureSection(Strict):
    """Where a length gauge's fixture stands in the base frame of the calibrated robot."""

    name: str
    position_mm: Position


class PlaceSection(Strict):
    """How a tracker's or plate's frame stands in the base frame of the calibrated robot (fixed axes x, y, z)."""

    name: str
    position_mm: Position
    rpy_deg: Position


class PointSection(Strict):
    """Where a measured point sits in the flange frame."""

    name: str
    map_mm: Position


class FramesSection(Strict):
    """Where the gauge stands after the fit."""

    fixtures: tuple[FixtureSection, ...]
    places: tuple[PlaceSection, ...]
    tool: tuple[PointSection, ...]
    zero_mm: float | None = None


class Identification(Strict):
    """``identification.json``, whole.

    ``known_anywhere_mm`` is the error of the tool that the covariance lets expect over the workspace, rms.
    """

    schema_: Literal["edbb-identification/1"] = Field(alias="schema")
    robot: str
    n_samples: int
    n_groups: int
    split: SplitSection
    stages: tuple[StageSection, ...]
    parameters: tuple[ParameterSection, ...]
    degrees_of_freedom: float
    findings: tuple[FindingSection, ...]
    limits: tuple[LimitSection, ...]
    rejected: tuple[RejectedSection, ...]
    tried: int | None
    unexplained: UnexplainedSection
    noise_floor_mm: float | None
    known_anywhere_mm: float
    condition_number: float | None
    correlation_time: float
    frames: FramesSection
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
