"""The cell file as the contract gives it (schema ``edbb-cell/1``): millimetres and degrees, units in the keys."""

from collections.abc import Sequence
from itertools import combinations, dropwhile
from math import dist
from typing import Annotated, ClassVar, Literal

from pydantic import (
    Field,
    NonNegativeInt,
    PositiveInt,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from planner.cell.gauge_registry import gauge_kinds, own_keys
from planner.common.choices import Aim, ReadBy, SelectionMethod, SetUp, TourOrder
from planner.common.extensions import HINT
from planner.common.schema import Coordinate, NonNegativeFloat, OneLine, OptionalKeys, PositiveFloat, StrictModel
from planner.kinematics.bodies import BodyFile, Vector


class IndicatorHeadFile(StrictModel):
    """``[gauge.head]``: three indicators whose axes meet at right angles in the MAP (TriCal paper, 2.1)."""

    indicators: tuple[Vector, Vector, Vector]  # from the MAP to each indicator, in the flange frame
    range_mm: PositiveFloat = 12.5
    usable_mm: PositiveFloat = 5.0
    tip_mm: PositiveFloat = 11.5
    approach_mm: PositiveFloat = 40.0
    master_mm: PositiveFloat = 38.1
    uncalibrated_mm: PositiveFloat = 4.0
    centre_s: PositiveFloat = 30.0


class BallFile(OptionalKeys):
    """``[[balls]]``: one ball or socket of an artifact, in the plate's own frame; its stem leads to ``stem_to_mm``."""

    name: OneLine
    position_mm: Vector
    radius_mm: PositiveFloat = 12.7
    stem_to_mm: Vector | None = None
    stem_radius_mm: PositiveFloat = 5.0
    axis: Vector = (0.0, 0.0, 1.0)  # of a socket, the way in which the ball leaves it
    LATER: ClassVar[tuple[str, ...]] = ("radius_mm", "stem_to_mm", "stem_radius_mm", "axis")


class PlacedFile(StrictModel):
    """Where something stands in the base frame, and how well that is known before measuring (one sigma)."""

    position_mm: Vector
    rpy_deg: Vector = (0.0, 0.0, 0.0)
    prior_mm: PositiveFloat = 1.0
    prior_deg: PositiveFloat = 0.1


class ArtifactFile(PlacedFile):
    """``[artifact]``: the plate that carries the balls; bodies in its own frame."""

    bodies: tuple[BodyFile, ...] = ()


class NestFile(StrictModel):
    """``[[tracker.nests]]``: a nest in the artifact's frame (the base's without one), and as the tracker read it."""

    name: OneLine
    position_mm: Vector
    read_mm: Vector | None = None


class TrackerFile(PlacedFile):
    """``[tracker]``: where the tracker stands, and the nests that tie its frame to the artifact's or the base's."""

    prior_mm: PositiveFloat = 2.0
    beam_radius_mm: PositiveFloat = 3.0
    nests: tuple[NestFile, ...] = ()


Number = Annotated[int, Field(ge=0, le=9999)]
Signal = Annotated[int, Field(ge=1, le=9999)]
AngleDeg = Annotated[float, Field(gt=0, le=180)]
FIRST_POINT = "1"  # name of the tool point at map_mm, where there are others


class PointFile(StrictModel):
    """``[[tool.points]]``: one more place on the tool for the bar's ball; ``[tool] map_mm`` is point "1"."""

    name: Annotated[str, Field(min_length=1)]
    map_mm: Vector
    map_axis: Vector | None = None  # the tool's own where it is not given


class ToolFile(OptionalKeys):
    """``[tool]``: the measurement application point (MAP) in the flange frame, and what is bolted on."""

    map_mm: Vector
    map_axis: Vector = (0.0, 0.0, 1.0)
    mass_kg: Annotated[float, Field(ge=0, le=5000.0)] = 0.0  # more than any arm carries
    com_mm: Vector = (0.0, 0.0, 0.0)
    bodies: tuple[BodyFile, ...] = ()
    prior_mm: PositiveFloat = 1.0
    map_sigma_um: PositiveFloat | None = None  # where the MAP was measured on the tool, by a CMM for instance
    points: tuple[PointFile, ...] = ()
    work_mm: Vector | None = None  # point of the tool that the robot works with, for which the error is stated too
    LATER: ClassVar[tuple[str, ...]] = ("map_sigma_um", "points", "work_mm")


class ConeFile(StrictModel):
    """Largest tilt of either ball joint from its axis."""

    fixture: AngleDeg = 70.0
    map: AngleDeg = 70.0


class BarFile(StrictModel):
    """The bar as a body: the housing goes with the fixture, the rod with the tool, both trimmed at the balls."""

    radius_mm: PositiveFloat = 15.0
    housing_mm: PositiveFloat = 250.0
    rod_radius_mm: PositiveFloat = 6.0
    trim_mm: PositiveFloat = 40.0


def _with_usual_keys(data: dict[str, object], kind: object, sections: Sequence[str]) -> dict[str, object]:
    """Return sections of a file in which the usual keys of a kind of gauge stand where none are given."""
    gauge = gauge_kinds().get(str(kind))
    for section in sections:
        usual, given = {} if gauge is None else gauge.usual_keys.get(section, {}), data.get(section, {})
        if usual and isinstance(given, dict):
            data = data | {section: {**usual, **given}}
    return data


class GaugeFile(OptionalKeys):
    """``[gauge]``: what is measured, its workspace and body."""

    kind: str
    length_mm: tuple[PositiveFloat, PositiveFloat] | None = None
    noise_um: PositiveFloat | None = None
    noise_mdeg: PositiveFloat = 5.0
    scale_ppm: Annotated[float, Field(gt=0, le=20_000)] | None = None  # one sigma of its scale, else what is usual
    read_by: ReadBy | None = None  # else as is usual for the kind
    reading_s: PositiveFloat | None = None  # of one reading, where the robot waits for it
    cone_deg: ConeFile = ConeFile()
    mount_deg: tuple[float, ...] | None = None
    mount_mm: tuple[float, ...] = ()  # of joints that slide
    zero: Literal["free", "known"] = "free"
    body: BarFile = BarFile()
    head: IndicatorHeadFile | None = None
    own: dict[str, object] = {}  # keys that only this kind of gauge has, written beside the others
    LATER: ClassVar[tuple[str, ...]] = ("head", "own", "mount_mm", "read_by", "reading_s", "scale_ppm")

    @classmethod
    def allowed_keys(cls, data: object) -> list[str]:
        """Return the keys of every gauge, and those of the kind that is named."""
        kind = data.get("kind") if isinstance(data, dict) else None
        return [*(key for key in cls.model_fields if key != "own"), *own_keys(kind)]

    @model_validator(mode="before")
    @classmethod
    def _own_keys(cls, data: object) -> object:
        """Set the kind's own keys apart, which the gauge reads itself; its usual keys stand where none are given."""
        if not isinstance(data, dict) or "own" in data:
            return data
        keys = own_keys(data.get("kind"))
        data = _with_usual_keys(data, data.get("kind"), ("body", "cone_deg"))
        return {k: v for k, v in data.items() if k not in keys} | {"own": {k: data[k] for k in keys if k in data}}

    @field_validator("kind")
    @classmethod
    def _check_kind(cls, value: str) -> str:
        if value not in gauge_kinds():
            raise ValueError(f"must be {' or '.join(map(repr, gauge_kinds()))}{HINT}")
        return value

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        return {k: v for k, v in self._set_keys(handler(self)).items() if k != "own"} | self.own

    @field_validator("length_mm")
    @classmethod
    def _check_order(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and value[0] >= value[1]:
            raise ValueError("the shortest length must come first and be smaller than the longest")
        if value is not None and value[1] < 5.0:
            raise ValueError("these look like metres; lengths are in millimetres")
        return value


class FixtureFile(OptionalKeys):
    """``[[fixtures]]``: one magnet cup that holds the bar's fixed ball.

    ``set_up``: how it comes to its place. "robot": the tool's ball is driven to ``position_mm`` and the cup adjusted to
    it there, so that it stands where the robot truly comes (EDBB paper, 3.1); "measured": its place was measured from
    the robot's base. Without the key it is what is usual for the gauge.
    """

    name: OneLine = "A"
    position_mm: Vector
    axis: Vector = (0.0, 0.0, 1.0)
    prior_mm: PositiveFloat = 5.0
    mount_deg: tuple[float, ...] | None = None
    mount_mm: tuple[float, ...] = ()  # of joints that slide
    set_up: SetUp | None = None
    LATER: ClassVar[tuple[str, ...]] = ("set_up", "mount_mm")


class MotionFile(OptionalKeys):
    """``[motion]``: how the measuring poses are joined.

    ``order``: by which time of a segment the order of the poses is the shortest, that of its slowest limit (axes, tool
    and bar), or that of its slowest axis alone at full speed (EDBB paper, eq. 7).
    """

    measure: Literal["continuous", "static"] = "continuous"
    both_ways: bool = True
    tool_speed_mm_min: Annotated[PositiveFloat, Field(ge=1)] = 1000.0
    blend_mm: NonNegativeFloat = 10.0
    clearance_mm: PositiveFloat = 10.0
    dwell_s: NonNegativeFloat = 1.0
    settle_s: NonNegativeFloat = 0.5
    travel_percent: Annotated[float, Field(ge=0.1, le=100)] = 100.0
    order: TourOrder = "slowest-limit"
    LATER: ClassVar[tuple[str, ...]] = ("order",)


class TwistFile(StrictModel):
    """``[[cable.sums]]``: the absolute twists of these axes, counted from home, together stay within the limit."""

    axes: tuple[PositiveInt, ...] = Field(min_length=1)
    limit_deg: PositiveFloat


class CableFile(StrictModel):
    """``[cable]``: budget of twist, as sums over axes and of the tool about the bar."""

    sums: tuple[TwistFile, ...] = ()
    tool_about_bar_deg: Annotated[float, Field(gt=0, lt=180)] | None = None


class BaseFile(OptionalKeys):
    """``[base]``: how the base stands (for gravity), the floor's height in the base frame, and which link it is.

    ``base = "torso"`` is short for ``[base]`` with ``link = "torso"``, the first link of the arm in the robot's URDF.
    """

    rpy_deg: Vector = (0.0, 0.0, 0.0)
    floor_mm: Coordinate | None = 0.0
    link: OneLine | None = None
    LATER: ClassVar[tuple[str, ...]] = ("link",)

    @model_validator(mode="before")
    @classmethod
    def _read_link_name(cls, data: object) -> object:
        return {"link": data} if isinstance(data, str) else data


class FloorFile(StrictModel):
    """``[floor]``: the rectangle in the base frame on which further stands of a bar may be put up."""

    x_mm: tuple[Coordinate, Coordinate]
    y_mm: tuple[Coordinate, Coordinate]

    @field_validator("x_mm", "y_mm")
    @classmethod
    def _check_order(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise ValueError("the first number must lie below the second one")
        return value


class ControllerFile(StrictModel):
    """``[controller]``: numbers to select, signals to use, what a file and a block may be, its own correction."""

    tool: Number | None = None
    base: Number | None = None
    load: Number | None = None
    sync_output: Signal | None = None
    gauge_input: Signal | None = None
    log_axes: bool = True
    part_lines: Annotated[int, Field(ge=20, le=1_000_000)] | None = None
    block_ms: Annotated[float, Field(gt=0, le=1000)] | None = None
    accuracy_model: Literal["off", "on"] = "off"
    dialects: tuple[str, ...] = ()  # none: the language of the robot's maker


class PlanSettingsFile(OptionalKeys):
    """``[plan]``: what is freed beside the robot's own parameters, and how much is tried."""

    free: tuple[Literal["fixture", "tool", "zero"], ...] = ("fixture", "tool", "zero")
    beta: Literal["auto", "none"] = "auto"
    poses: PositiveInt | None = None
    candidates: Annotated[int, Field(gt=0, le=2_000_000)] = 100_000
    grid_step_deg: PositiveFloat | None = None
    index: Literal["O1", "O2", "O3", "O4", "O5"] = "O2"
    refine: bool = True
    repeat: NonNegativeInt = 3
    validate_: NonNegativeInt = Field(default=10, alias="validate")
    effects: tuple[str, ...] = ()  # kinds of the catalogue that the fit will have beside geometry
    aim: Aim | None = None  # poses by the index, or by what would be left of what nobody declared
    method: SelectionMethod | None = None  # how the index selects: by exchange where nothing is said
    as_published: bool = False  # every stage by the method of the EDBB paper
    LATER: ClassVar[tuple[str, ...]] = ("effects", "aim", "method", "as_published")


RobotClass = Literal["industrial", "hobby"]


class UseFile(OptionalKeys):
    """``[use]``: what the robot is to be good enough for: with which tool, and how far off it may be at a target."""

    tolerance_mm: Annotated[PositiveFloat, Field(ge=0.001, le=1000)] | None = None
    tool: Literal["measured", "own", "another"] | None = None  # own: that of [tool] work_mm
    LATER: ClassVar[tuple[str, ...]] = ("tolerance_mm", "tool")


class PriorFile(StrictModel):
    """``[prior]``: what is known of robots of this kind: the file of a fleet."""

    fleet: OneLine


class CellFile(OptionalKeys):
    """The whole cell file."""

    schema_: Literal["edbb-cell/1"] = Field(alias="schema")
    robot: OneLine
    class_: RobotClass | None = Field(default=None, alias="class")  # how large errors of such robots are before any run
    tip: str | None = None
    packages: dict[str, str] = {}  # folders of ROS packages that the robot's URDF names
    parked: dict[str, Coordinate] = {}  # where joints of the URDF stand that the arm does not drive
    home_deg: tuple[float, ...] | None = None
    home_mm: tuple[float, ...] = ()  # of joints that slide
    tool: ToolFile | None = None
    gauge: GaugeFile
    fixtures: tuple[FixtureFile, ...] = ()
    balls: tuple[BallFile, ...] = ()
    artifact: ArtifactFile | None = None
    tracker: TrackerFile | None = None
    # 500: each pair of bodies is judged by itself; many small ones are one mesh
    obstacles: tuple[BodyFile, ...] = Field(default=(), max_length=500)
    motion: MotionFile = MotionFile()
    cable: CableFile = CableFile()
    base: BaseFile = BaseFile()
    floor: FloorFile | None = None
    controller: ControllerFile = ControllerFile()
    plan: PlanSettingsFile = PlanSettingsFile()
    use: UseFile | None = None
    prior: PriorFile | None = None
    LATER: ClassVar[tuple[str, ...]] = (
        "class_", "artifact", "tracker", "packages", "parked", "floor", "home_mm", "use", "prior",
    )  # fmt: skip
    ADDED: ClassVar[tuple[str, ...]] = ()  # sections of extensions, which a model made of this one has

    @model_validator(mode="before")
    @classmethod
    def _usual_plan(cls, data: object) -> object:
        """Let the gauge say what is planned where nothing else is asked for."""
        if not isinstance(data, dict) or not isinstance(gauge := data.get("gauge"), dict):
            return data
        return _with_usual_keys(data, gauge.get("kind"), ("plan",))

    def _set_keys(self, out: dict[str, object]) -> dict[str, object]:
        """Write the sections of extensions with what else stands in the cell, before it is said how it is driven."""
        added = {key: rows for key in self.ADDED if (rows := out.pop(key, ()))}
        kept = super()._set_keys(out)
        driven = {key: kept.pop(key) for key in list(dropwhile(lambda key: key != "motion", kept))}
        return kept | added | driven

    @model_validator(mode="after")
    def _names(self) -> "CellFile":
        points = [FIRST_POINT, *(p.name for p in self.tool.points)] if self.tool else []
        for what, names in (("fixtures", [f.name for f in self.fixtures]), ("tool points", points)):
            if len(set(names)) < len(names):
                raise ValueError(f"two {what} share a name ({', '.join(names)})")
        return self

    @model_validator(mode="after")
    def _check_apart(self) -> "CellFile":
        """Two fixtures, tool points, balls or nests at one place would be counted as two and show what one shows."""
        points = [(FIRST_POINT, self.tool.map_mm), *((p.name, p.map_mm) for p in self.tool.points)] if self.tool else []
        kinds = (
            ("fixtures", [(f.name, f.position_mm) for f in self.fixtures]), ("tool points", points),
            ("balls", [(b.name, b.position_mm) for b in self.balls]),
            ("nests", [(n.name, n.position_mm) for n in self.tracker.nests] if self.tracker else []),
        )  # fmt: skip
        for what, placed in kinds:
            for (one, here), (other, there) in combinations(placed, 2):
                if (apart := dist(here, there)) < 1.0:  # [mm] nearer they are one
                    raise ValueError(f"{what} '{one}' and '{other}' stand at one place ({apart:g} mm apart)")
        return self
