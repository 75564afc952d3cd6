"""The robot that everything else works with, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from planner.common.console import as_word
from planner.common.content_hashes import HandEdit
from planner.common.errors import InputError, did_you_mean
from planner.common.units import DEG, MM, Array, read_only
from planner.kinematics.axes import AxisConvention, advice, names_of
from planner.kinematics.bodies import Body
from planner.kinematics.chain import Chain, Transform, xyz_transforms
from planner.kinematics.packages import NO_PACKAGES, Packages


@dataclass(frozen=True)
class LinkMass:
    """Mass [kg] and centre of mass (3,) [m] of one link, in the link's frame."""

    mass: float
    com: Array


# A joint that slides counts its travel such that a millimetre of it is what a degree is of a joint that turns. So one
# number does at the border for either, with the unit beside it, and theta = A q + theta_zero is in m there.
SLIDE = MM / DEG  # [m/rad]

# how the base stands; before the rows
BASE_TRANSFORMS = (*xyz_transforms("base_", "translation"), *xyz_transforms("base_r", "rotation"))


@dataclass(frozen=True)
class RobotEffect:
    """An effect beyond geometry: ``value`` times the basis function ``phi`` is added to the transform ``on``.

    Attributes:
        name: for instance ``compliance2``.
        on: name of an elementary transform of the robot or of its base, for instance ``theta2``.
        phi: key of the basis function, for instance ``torque:2``; the room ``effects`` can read it.
        value, unit: in SI units, for instance rad/Nm.
        static: whether it depends on joint angles and loads alone, so that targets can be compensated for it.
    """

    name: str
    on: str
    phi: str
    value: float
    unit: str
    static: bool = True


@dataclass(frozen=True)
class Loads:
    """Tool mass [kg], its centre of mass com_F (3,) [m] in the flange, and how the base stands, rpy (3,) [rad]."""

    payload: float
    com_F: Array
    base_rpy: Array


@dataclass(frozen=True)
class ToolPoint:
    """A measured point of the tool.

    Attributes:
        name: of the point, empty where the tool has only one.
        p_FM: in the flange of the calibrated robot, (3,) [m].
        std: its standard deviations in the true flange, (3,) [m], or ``None``.
        std_beside_robot: the same in the flange of this robot, which counts as known.
    """

    name: str
    p_FM: Array
    std: Array | None = None
    std_beside_robot: Array | None = None


@dataclass(frozen=True)
class ParkedJoint:
    """A joint of a URDF that stands still while the arm is measured.

    Attributes:
        name: as the URDF has it.
        value: where it stands [rad, or m].
        unit: ``deg`` or ``mm``, in which a person is told.
        why: where the value comes from, if neither a file says it nor it is 0.
        of_chain: whether it lies between the base and the tip.
        follows: whether another joint moves it.
    """

    name: str
    value: float
    unit: str
    why: str = ""
    of_chain: bool = False
    follows: bool = False

    @property
    def displayed_value(self) -> float:
        """Its value in degrees or millimetres."""
        return float(self.value / (MM if self.unit == "mm" else DEG)) + 0.0

    @property
    def text(self) -> str:
        """Its value as a person reads it."""
        return f"{self.displayed_value:.6g} {self.unit}"


@dataclass(frozen=True)
class Priors:
    """One-sigma sizes of errors before calibration: lengths [m], angles [rad], compliances of joints [rad/Nm].

    An industrial robot misses by 1–4 mm before calibration; 1 mrad is about 1 mm at a metre. Compliances: TriCal paper,
    Table 8, up to 0.2 · 10⁻³ °/Nm for a robot of the 6 kg class.
    """

    length: float = 1e-3
    angle: float = 1e-3
    compliance: float = 2e-6
    factors: tuple[tuple[str, float], ...] = ()
    """How much larger than usual errors of a group are, as a fleet has shown: ``lengths, joint 3``, a cause."""
    sizes: tuple[tuple[str, float], ...] = ()
    """Sizes of single errors by their names, in their units: what a person states comes before all else."""

    def size(self, name: str, usual: float) -> float:
        """Return the size of an error by its name: the one that was stated, else the usual one."""
        return dict(self.sizes).get(name, usual)

    def factor(self, group: str) -> float:
        """Return how much larger than usual the errors of a group are; 1 where no fleet has shown it."""
        return next((value for name, value in self.factors if name == group), 1.0)


@dataclass(frozen=True)
class Robot:
    """A chain of five joints or more that turn, or slide.

    Joint variables q are angles [rad]; of a joint that slides q is its travel over ``SLIDE``.

    Attributes:
        name: short name, as cell files use it.
        title: what a person calls it.
        convention: ``dh``, ``mdh`` or ``urdf``.
        transforms: elementary transforms from the base to the flange.
        link_end: number of transforms up to the end of link frame 0 (the base) … N.
        coupling_matrix: A of ``theta = A q + theta_zero``, (N, N); the row of a joint that slides holds ``SLIDE``.
        theta_zero: (N,) [rad].
        q_lower, q_upper: limits of the joints, (N,) [rad].
        speed, acceleration, jerk: of the joints, (N,) [rad/s, rad/s², rad/s³].
        repeatability: of the tool point [m]; ``repeatability_assumed`` where its file does not say it.
        payload: rated payload [kg], or ``None``.
        masses: of links 1 … N, ``None`` where unknown.
        bodies: (link, shape) pairs; link 0 is the base.
        gear_ratio: per joint, ``None`` where unknown.
        never_meet: pairs of links next but one that the maker's own strokes keep apart, so that they are not checked.
        never_meet_reason: what keeps them apart, for the user.
        sources: topic → where the numbers come from.
        path: the file it was read from.
        base: first link of the chain, where its file (or the cell's) says that it is not the root of the URDF.
        tip: last link, where the chain comes from a URDF; ``srdf`` the file that says which of its links may touch.
        joint_names: as the arm's own software calls them, empty where they have no names.
        dialect: language of its maker's controller.
        effects: what a calibration found beyond geometry; ``loads`` those that it was found under.
        priors: how large its errors usually are.
        nominal_transforms: those of the controller's own model, where they differ from ``transforms``.
        conventions: how the controllers that its file names count its axes.
        tool_points: of a calibrated robot, where the points that were measured sit in its flange.
        simulated: of a calibrated robot, whether its readings were simulated; ``None`` where its file does not say.
        not_for_use: of a calibrated robot, why nothing may be made of it; empty where it may be used.
        packages: folders of ROS packages that its URDF names.
        parked: joints of its URDF that stand still.
        neighbours: of a robot from a URDF, the pairs of rigid parts that a joint of the arm joins; of others those of
            links with numbers that follow each other.
        never_meet_parts: pairs of links of its URDF that are not checked against each other: both names, and why.
        unchecked_links: links of its URDF that no collision check knows: the name, and why.
        lacking_meshes: a sentence on each mesh of its URDF that is not there; its body is left out.
        hand_edits: what a person changed in the files of its calibration and fleet since edbb wrote them.

    Example:
        >>> robot = load_robot("comau-nj130")  # doctest: +SKIP
        >>> robot.n_joints  # doctest: +SKIP
    """

    name: str
    title: str
    convention: str
    transforms: tuple[Transform, ...]
    link_end: tuple[int, ...]
    coupling_matrix: Array
    theta_zero: Array
    q_lower: Array
    q_upper: Array
    speed: Array
    acceleration: Array
    jerk: Array
    repeatability: float
    payload: float | None
    masses: tuple[LinkMass | None, ...]
    bodies: tuple[tuple[int, Body], ...]
    gear_ratio: tuple[float | None, ...]
    never_meet: frozenset[tuple[int, int]]
    never_meet_reason: str
    sources: tuple[tuple[str, str], ...]
    path: Path
    base: str | None = None
    tip: str | None = None
    srdf: Path | None = None
    joint_names: tuple[str, ...] = ()
    dialect: str | None = None
    effects: tuple[RobotEffect, ...] = ()
    loads: Loads | None = None
    priors: Priors = Priors()
    nominal_transforms: tuple[Transform, ...] = ()
    conventions: tuple[AxisConvention, ...] = ()
    packages: Packages = NO_PACKAGES
    tool_points: tuple[ToolPoint, ...] = ()
    simulated: bool | None = None
    not_for_use: str = ""
    unchecked_links: tuple[tuple[str, str], ...] = ()
    parked: tuple[ParkedJoint, ...] = ()
    neighbours: frozenset[frozenset[str]] = frozenset()
    never_meet_parts: tuple[tuple[str, str, str], ...] = ()
    repeatability_assumed: bool = False
    lacking_meshes: tuple[str, ...] = ()
    hand_edits: tuple[HandEdit, ...] = ()

    def __repr__(self) -> str:
        """Name the robot and its file."""
        return f"Robot('{self.name}', joints={self.n_joints}, path='{self.path}')"

    @cached_property
    def nominal_robot(self) -> Robot:
        """The robot that the controller believes in: without what a calibration changed; most robots are their own."""
        if not self.nominal_transforms and not self.effects:
            return self
        rows = self.nominal_transforms or self.transforms
        return replace(self, transforms=rows, nominal_transforms=(), effects=())

    def check_meshes(self) -> None:
        """Check that all meshes are there, as whoever looks for collisions needs them.

        Raises:
            InputError: one is not, with what to add.
        """
        if self.lacking_meshes:
            more = f" (and {len(self.lacking_meshes) - 1} more)" if len(self.lacking_meshes) > 1 else ""
            raise InputError(f"{self.lacking_meshes[0]}{more}")

    @property
    def n_joints(self) -> int:
        """Number of joints N."""
        return len(self.speed)

    @cached_property
    def slides(self) -> np.ndarray:
        """Which joints slide, (N,) bool; the others turn."""
        return np.array([self.transforms[k].kind == "translation" for k in self.chain.joint_places], dtype=bool)

    @cached_property
    def joint_units(self) -> tuple[str, ...]:
        """The unit of each joint at the border, ``deg`` or ``mm``."""
        return tuple("mm" if slides else "deg" for slides in self.slides)

    def joint_text(self, joint: int, q: float, form: str = ".4f") -> str:
        """Return a value of a joint (from 0) as a person reads it: ``12.5°``, of one that slides ``12.5 mm``."""
        return f"{q / DEG:{form}}{' mm' if self.slides[joint] else '°'}"

    @property
    def slide_numbers(self) -> frozenset[int]:
        """Numbers of the joints that slide, from 1."""
        return frozenset((np.flatnonzero(self.slides) + 1).tolist())

    def joint_columns(self, stem: str) -> list[str]:
        """Return the columns of a quantity of the joints: ``q1_deg``, or ``q1_mm`` of one that slides."""
        return [f"{stem}{j}_{unit}" for j, unit in enumerate(self.joint_units, start=1)]

    @cached_property
    def zero_names(self) -> tuple[str, ...]:
        """Names of the transforms that the joints move: an error of one is an error of that joint's zero."""
        return tuple(self.transforms[k].name for k in self.chain.joint_places)

    @property
    def one_turn(self) -> tuple[Array, Array]:
        """Range of each joint, both ends (N,): of a joint that turns no more than a turn about 0."""
        lower, upper = np.maximum(self.q_lower, -np.pi), np.minimum(self.q_upper, np.pi)
        return np.where(self.slides, self.q_lower, lower), np.where(self.slides, self.q_upper, upper)

    @cached_property
    def chain(self) -> Chain:
        """The chain from the base to the flange."""
        return Chain(self.transforms)

    @property
    def parked_table(self) -> dict[str, float]:
        """Where the joints stand that are parked, as the table ``[parked]`` says it."""
        return {f"{j.name}_{j.unit}": j.displayed_value for j in self.parked if not j.follows}

    def theta(self, q: Array) -> Array:
        """Convert joint angles (n, N) [rad] to the variable part of the kinematic rows' angles."""
        return q @ self.coupling_matrix.T + self.theta_zero

    def axes_of(self, controller: str) -> AxisConvention:
        """Return how a controller counts the axes of this robot; ``controller`` is the name of its language.

        Raises:
            InputError: the robot's file does not say; with the lines to be added.
        """
        found = {c.controller: c for c in self.conventions}
        if controller in found:
            return found[controller]
        raise InputError(
            f"{self.path}: does not say how the axes of '{controller}' follow from the joints of {self.name}"
            f"{did_you_mean(controller, list(found))} (it says so of: {names_of(self.conventions)}), and a program or "
            "log in the wrong axes makes a wrong robot. Jog each axis by +10 degrees, compare with the model "
            f"(docs/how-to/robot.md), and add\n{advice(controller, self.n_joints, len(self.slide_numbers))}"
            f"{_needs_file(self)}"
        )

    def in_axes(self, convention: AxisConvention) -> Robot:
        """Return this robot, rigid, with the axes of a controller as its joints: its q are the controller's angles."""
        if convention.is_same:
            return self.nominal_robot
        back = self.coupling_matrix @ convention.inverse
        return replace(
            self.nominal_robot,
            coupling_matrix=read_only(back),
            theta_zero=read_only(self.theta_zero - back @ convention.zero),
            q_lower=convention.lower,
            q_upper=convention.upper,
            speed=convention.speed,
            acceleration=convention.largest(self.acceleration),
            jerk=convention.largest(self.jerk),
            conventions=(),
        )

    def usual_error(self, q: Array, p_FM: Array) -> float:
        """Return how far off a point (3,) [m] of the flange usually is at q (N,) [rad], one sigma of a direction [m].

        It is that of errors as large as ``priors``, before any calibration.
        """
        stand = self.chain.forward(self.theta(q[None]))
        at_point = replace(stand, x=stand.x + np.einsum("ijn,j->in", stand.R, p_FM))
        size = np.where(stand.rotation, self.priors.angle, self.priors.length)
        free = np.array([not t.fixed for t in self.transforms])
        return float(np.sqrt(((at_point.point_screws()[:, :, 0] * (size * free)[:, None]) ** 2).sum() / 3))

    @property
    def usual_turn(self) -> float:
        """How far its flange is usually turned from where it is told to be: an angle of ``priors`` a joint [rad]."""
        return self.priors.angle * float(np.sqrt(self.n_joints))

    def flange_frame(self) -> Array:
        """Return the flange in the last link frame (transforms after the last row), (4, 4) [m]."""
        T = np.eye(4)
        for t in self.transforms[self.link_end[-1] :]:
            T = T @ elementary_placement(t, t.nominal)
        return T


def _needs_file(robot: Robot) -> str:
    """Say what has to be written first where the robot was read from a file that has no room for such tables."""
    if robot.path.suffix == ".toml":
        return ""
    if robot.path.suffix == ".csv":
        step = f"edbb robots {as_word(robot.path)} -o {as_word(robot.name)}"
        return (
            f"\n(a table of rows has no room for it: {step} writes it as {robot.name}/robot.toml; add the lines there, "
            f'and let the cell say robot = "{robot.name}/robot.toml")'
        )
    return (
        f'\n(a URDF has no room for it: write a robot.toml beside it with schema = "edbb-robot/1", '
        f'name = "{robot.name}", convention = "urdf", urdf = "{robot.path.name}", tip = "{robot.tip}", and give '
        "that to the cell)"
    )


def elementary_placement(t: Transform, value: float) -> Array:
    """Return one elementary transform of a value [m or rad] as a pose (4, 4) [m]."""
    T = np.eye(4)
    if t.kind == "translation":
        T[t.axis, 3] = value
        return T
    b, c = (t.axis + 1) % 3, (t.axis + 2) % 3
    cos, sin = np.cos(value), np.sin(value)
    T[b, b], T[b, c], T[c, b], T[c, c] = cos, -sin, sin, cos
    return T
