"""The file ``robot.toml`` as the contract gives it (schema ``edbb-robot/1``): millimetres and degrees."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from planner.common.schema import Coordinate, OneLine, PositiveFloat, StrictModel
from planner.common.units import DEG, MM, from_deg, from_mm, read_only, to_mm
from planner.kinematics.angle_units import radians_text
from planner.kinematics.axes import ControllerTable
from planner.kinematics.bodies import LinkBodyFile, Vector
from planner.kinematics.calibration_files import LENGTHS, ROW_KEYS, LoadsTable, RobotEffectTable, ToolPointTable
from planner.kinematics.robot import LinkMass, Priors
from planner.kinematics.robot_numbers import LinkMassKg, PayloadKg, ReachMm, RepeatabilityMm
from planner.kinematics.urdf import UrdfJoint

SPEED_TIME = 0.25  # [s] to full speed, and the ratio acceleration/jerk, where a file leaves them unsaid
NEXT_BUT_ONE = 2  # links apart


DRIVE_KEYS = {  # what planning asks of a joint: the keys of one that turns, and of one that slides
    "zero": ("zero_deg", "zero_mm"),
    "limit": ("limit_deg", "limit_mm"),
    "speed": ("speed_deg_s", "speed_mm_s"),
    "acceleration": ("acceleration_deg_s2", "acceleration_mm_s2"),
    "jerk": ("jerk_deg_s3", "jerk_mm_s3"),
}


class JointTable(StrictModel):
    """One ``[[joints]]`` table, from base to flange; ``name`` as the arm's own software calls the joint.

    ``variable``: what of its row a joint moves, ``d`` where it slides; its limits and speeds are then in mm.
    """

    variable: Literal["theta", "d"] = "theta"
    name: Annotated[str, Field(pattern=r"^[A-Za-z][\w/.-]*$")] = ""
    alpha_deg: Coordinate | None = None
    a_mm: Coordinate | None = None
    d_mm: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None  # of near-parallel axes it may lie far out
    theta_deg: Coordinate | None = None
    beta_deg: Coordinate | None = None
    sense: Literal[1, -1] = 1
    zero_deg: Coordinate = 0.0
    couple: dict[int, Coordinate] = {}
    limit_deg: tuple[Coordinate, Coordinate] | None = None  # these four may be left out where nothing is planned
    speed_deg_s: PositiveFloat | None = None
    acceleration_deg_s2: PositiveFloat | None = None
    jerk_deg_s3: Annotated[float, Field(gt=0, le=1e9)] | None = None
    zero_mm: Coordinate = 0.0
    limit_mm: tuple[Coordinate, Coordinate] | None = None
    speed_mm_s: PositiveFloat | None = None
    acceleration_mm_s2: PositiveFloat | None = None
    jerk_mm_s3: Annotated[float, Field(gt=0, le=1e9)] | None = None
    gear_ratio: PositiveFloat | None = None
    mass_kg: LinkMassKg | None = None
    com_mm: Vector | None = None

    @field_validator("limit_deg", "limit_mm")
    @classmethod
    def _check_order(cls, value: tuple[float, float] | None, info: ValidationInfo) -> tuple[float, float] | None:
        least_stroke = 5.0  # [mm] limits of a slide that are all nearer to 0 are metres
        if value is None:
            return None
        if value[0] >= value[1]:
            raise ValueError("the lower limit must lie below the upper one")
        largest = max(abs(v) for v in value)
        if info.field_name == "limit_deg" and largest <= 2 * np.pi + 1e-9:
            raise ValueError("these look like radians; limits are in degrees")
        if info.field_name == "limit_mm" and largest <= least_stroke:
            raise ValueError("these look like metres; limits of a joint that slides are in millimetres")
        return value

    @classmethod
    def from_urdf(cls, joint: UrdfJoint, said: "JointTable | None" = None) -> "JointTable":
        """Return what a URDF says of a joint, with what ``said`` has of it instead."""
        show = to_mm if joint.slides else np.rad2deg
        lower, upper = (float(show(v)) for v in (joint.lower, joint.upper))
        said_of = {"speed": joint.speed, "acceleration": joint.acceleration, "jerk": joint.jerk}
        drives: dict[str, Any] = {
            "limit": (lower, upper) if np.isfinite([lower, upper]).all() else None,
            **{key: float(show(v)) if v > 0 else None for key, v in said_of.items()},
        }
        found = cls.model_construct(  # limits of a few degrees are right in a file that has radians
            variable="d" if joint.slides else "theta",
            sense=joint.sense,
            name=joint.name,
            **{DRIVE_KEYS[key][joint.slides]: value for key, value in drives.items()},
        )
        told = {} if said is None else {k: getattr(said, k) for k in said.model_fields_set}
        return found.model_copy(update=told | {"variable": found.variable})

    @property
    def slides(self) -> bool:
        """Whether it slides; else it turns."""
        return self.variable == "d"

    def drive(self, key: str) -> Any:
        """Return its zero, limits (both ends), speed, acceleration or jerk, in degrees or millimetres."""
        return getattr(self, DRIVE_KEYS[key][self.slides])

    @property
    def foreign_key(self) -> str | None:
        """A key that is given in the unit of the other kind of joint; ``None`` where there is none."""
        others = (keys[not self.slides] for keys in DRIVE_KEYS.values())
        return next((key for key in others if key in self.model_fields_set), None)

    def with_estimates(self) -> "JointTable":
        """Return the joint with acceleration and jerk, each where it is unsaid estimated from the speed."""
        if (speed := self.drive("speed")) is None:
            return self
        acceleration = self.drive("acceleration") or speed / SPEED_TIME
        found = {"acceleration": acceleration, "jerk": self.drive("jerk") or acceleration / SPEED_TIME}
        return self.model_copy(update={DRIVE_KEYS[key][self.slides]: value for key, value in found.items()})

    @property
    def row(self) -> dict[str, float]:
        """The joint's row of DH parameters, those that are given [m, rad]."""
        given = {key: getattr(self, name) for key, name in ROW_KEYS.items()}
        return {key: v * (MM if key in LENGTHS else DEG) for key, v in given.items() if v is not None}

    @property
    def mass(self) -> LinkMass | None:
        """Mass and centre of mass of the link, where they are given."""
        if self.mass_kg is None:
            return None
        return LinkMass(self.mass_kg, read_only(from_mm(self.com_mm or (0, 0, 0))))


class FlangeTable(StrictModel):
    """The fixed transform after the last row."""

    position_mm: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector = (0.0, 0.0, 0.0)


class PriorsTable(StrictModel):
    """``[priors]``: one-sigma sizes of a robot's errors before it is calibrated."""

    length_mm: PositiveFloat = 1.0
    angle_deg: PositiveFloat = 0.0573
    compliance_urad_Nm: PositiveFloat = 2.0

    def priors(self) -> Priors:
        """Return the prior sigmas in SI units."""
        return Priors(self.length_mm * MM, float(from_deg(self.angle_deg)), self.compliance_urad_Nm * 1e-6)


class RobotDescription(StrictModel):
    """The whole ``robot.toml`` (schema ``edbb-robot/1``)."""

    schema_: Literal["edbb-robot/1"] = Field(alias="schema")
    name: OneLine
    title: OneLine = ""
    convention: Literal["dh", "mdh", "urdf"]
    urdf: str | None = None
    srdf: str | None = None
    base: str | None = None
    tip: str | None = None
    packages: dict[str, str] = {}  # folders of ROS packages that the URDF names
    repeatability_mm: RepeatabilityMm = 0.05
    dialect: str | None = None
    payload_kg: PayloadKg | None = None
    reach_mm: ReachMm | None = None
    sources: dict[str, str] = {}
    flange: FlangeTable = FlangeTable()
    priors: PriorsTable = PriorsTable()
    joints: tuple[JointTable, ...] = ()
    bodies: tuple[LinkBodyFile, ...] = ()
    parked: dict[str, Coordinate] = {}  # where joints of the URDF stand that the arm does not drive
    never_meet: tuple[tuple[int, int] | tuple[OneLine, OneLine], ...] = ()  # numbers of links, or names of a URDF's
    never_meet_reason: str = ""
    effects: tuple[RobotEffectTable, ...] = ()
    loads: LoadsTable | None = None
    nominal: dict[str, float] = {}
    tool_points: tuple[ToolPointTable, ...] = ()
    simulated: bool | None = None
    not_for_use: str = ""  # why nothing may be made of this calibrated robot
    hashes: dict[str, str] = {}  # of what a calibration wrote
    controllers: dict[Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")], ControllerTable] = {}

    @model_validator(mode="after")
    def _check_complete(self) -> "RobotDescription":
        apart = [pair for pair in self.numbered_pairs if abs(pair[0] - pair[1]) != NEXT_BUT_ONE]
        if apart:
            raise ValueError(
                f"never_meet = {[list(p) for p in apart]}: only links next but one may be left out (neighbours always "
                "are); others that touch are a collision"
            )
        if self.never_meet and not self.never_meet_reason.strip():
            raise ValueError("never_meet needs never_meet_reason: what keeps those links apart")
        if self.convention == "urdf":
            if self.urdf is None:
                raise ValueError('convention "urdf" needs urdf = "file.urdf"')
            return self
        for key in ("alpha_deg", "theta_deg"):
            if radians := radians_text(key, [getattr(joint, key) for joint in self.joints]):
                raise ValueError(radians)
        self._check_rows()
        return self

    def _check_rows(self) -> None:
        """Refuse what a robot of DH or MDH rows lacks, or cannot have."""
        if said := [k for k in ("srdf", "parked", "base", "tip") if k in self.model_fields_set]:
            raise ValueError(f"{said[0]} is for a URDF, and convention is '{self.convention}'")
        if self.named_pairs:
            raise ValueError(f"never_meet = {list(self.named_pairs[0])}: links of rows have numbers, 0 is the base")
        for i, joint in enumerate(self.joints, 1):
            gone = [k for k in ("alpha_deg", "a_mm", "d_mm", "theta_deg") if getattr(joint, k) is None]
            if gone:
                raise ValueError(f"joint {i} has no {', '.join(gone)}, which convention '{self.convention}' needs")
            if key := joint.foreign_key:
                kind = 'slides (variable = "d")' if joint.slides else 'turns (one that slides has variable = "d")'
                raise ValueError(f"joint {i} {kind}, and has {key}")
            sliding = [k for k in (i, *joint.couple) if 1 <= k <= len(self.joints) and self.joints[k - 1].slides]
            if joint.couple and sliding:
                raise ValueError(
                    f"joint {i} is coupled, and joint {sliding[0]} slides: only joints that turn are coupled"
                )
            wrong = [j for j in joint.couple if not 1 <= j <= len(self.joints)]
            if wrong:
                raise ValueError(f"joint {i} is coupled to joint {wrong[0]}, but there are {len(self.joints)} joints")
        far = [b.link for b in self.bodies if b.link > len(self.joints)]
        if far:
            raise ValueError(f"a body sits on link {far[0]}, but the last link is {len(self.joints)}")

    @property
    def numbered_pairs(self) -> tuple[tuple[int, int], ...]:
        """The pairs of ``never_meet`` by the links' numbers."""
        return tuple((a, b) for a, b in self.never_meet if isinstance(a, int) and isinstance(b, int))

    @property
    def named_pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs of ``never_meet`` by the names of links of the URDF."""
        return tuple((a, b) for a, b in self.never_meet if isinstance(a, str) and isinstance(b, str))
