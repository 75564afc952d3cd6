"""Errors of one robot over what is usual of its kind, as its readings alone say, and whether a fleet has the like.

Of geometry the estimates of the released robot are used, less what its own prior drew them in by (1/s² − 1/σ² of the
readings alone). Of gears and compliances the sizes that its run has learnt, where it leaves no doubt whether they act.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from planner.cell.fleet_file import FleetFile
from planner.common.units import Array
from planner.effects.compliance import JOINT_COMPLIANCE
from planner.effects.effect import geometry_group
from planner.kinematics.robot import Robot
from planner.model.identification_document import Identification

BACKGROUND_WORD = re.compile(r" \(background\)$")
LEARNT_KINDS = re.compile(r"(gear once a turn|gear twice a turn|gear harmonics|gear ripple), joint \d+")


@dataclass(frozen=True)
class RobotErrors:
    """Errors of one robot over their usual sizes, as its readings alone say.

    Attributes:
        name: of the robot, for a person.
        groups: of each error, (n,).
        value, std: (n,).
    """

    name: str
    groups: tuple[str, ...]
    value: Array
    std: Array

    @classmethod
    def of(cls, name: str, document: Identification, robot: Robot) -> "RobotErrors":
        """Take them from an identification and the robot that it released."""
        found = [*_geometry(document, robot), *_effects(document), *_declared_compliances(document, robot)]
        groups, value, std = zip(*found, strict=True) if found else ((), (), ())
        return cls(name, tuple(groups), np.array(value, dtype=float), np.array(std, dtype=float))

    def is_copy_of(self, other: "RobotErrors") -> bool:
        """Return whether both are of one calibration: two robots never agree in every digit."""
        same = self.groups == other.groups and np.array_equal(self.value, other.value)
        return same and bool(self.groups) and np.array_equal(self.std, other.std)


def _geometry(document: Identification, robot: Robot) -> Iterator[tuple[str, float, float]]:
    """Yield group, value and standard deviation of every length and angle that the run shows."""
    factors = {f.name: f.factor for f in document.release.families} if document.release else {}
    place = {t.name: geometry_group(robot, k) for k, t in enumerate(robot.transforms)}
    for e in document.estimates:
        if e.group != "geometry" or not e.identifiable or not e.std or e.name not in place:
            continue
        usual = robot.priors.length if e.unit == "m" else robot.priors.angle
        prior = usual * robot.priors.factor(place[e.name]) * factors.get("lengths" if e.unit == "m" else "angles", 1.0)
        # 0.9: of the prior's variance, from where on the estimate is the prior
        if prior <= 0.0 or e.std**2 > 0.9 * prior**2:
            continue
        alone = 1.0 / (1.0 / e.std**2 - 1.0 / prior**2)
        yield place[e.name], (e.value - e.nominal) * alone / e.std**2 / usual, float(np.sqrt(alone)) / usual


def _effects(document: Identification) -> Iterator[tuple[str, float, float]]:
    """Yield group and size of the gears and compliances of which a run leaves no doubt whether they act."""
    present, absent = 0.9, 0.02  # [probability] from where on an effect acts, and up to where it does not
    for family in document.release.families if document.release else ():
        name = BACKGROUND_WORD.sub("", family.name)
        kind, _, joint = name.partition(", ")
        group = f"compliance, {joint}" if kind == JOINT_COMPLIANCE else name
        if not joint or (kind != JOINT_COMPLIANCE and not LEARNT_KINDS.fullmatch(name)):
            continue
        if family.probability >= present:
            yield group, family.factor / family.probability, 0.2  # as well as a size is learnt from one gear
        elif family.probability <= absent:
            yield group, 0.0, 0.2


def _declared_compliances(document: Identification, robot: Robot) -> Iterator[tuple[str, float, float]]:
    """Yield group, value and standard deviation of compliances that a cell declares: they are fitted joint by joint."""
    joints = {f"compliance{j}": j for j in range(1, robot.n_joints + 1)}
    for e in document.estimates:
        if e.group == JOINT_COMPLIANCE and e.identifiable and e.std and e.name in joints:
            usual = robot.priors.compliance
            yield f"compliance, joint {joints[e.name]}", (e.value - e.nominal) / usual, e.std / usual


@dataclass(frozen=True)
class Misfit:
    """Errors of a robot that do not fit the others: its name, the group, how many times as large, and the chance."""

    name: str
    group: str
    times: float
    chance: float

    @property
    def sentence(self) -> str:
        """Say in a sentence which group does not fit, and by how much."""
        return (
            f"{self.name} does not fit the fleet: {self.group} are {self.times:.1f} times as large as those of the "
            f"others (chance {self.chance:.0e})"
        )


def misfits_of(robot: RobotErrors, fleet: FleetFile) -> Iterator[Misfit]:
    """Yield the groups whose errors are too large for a fleet, one chance in a thousand over all groups (Bonferroni).

    The size of the fleet is itself known to a factor only: it counts as larger by one standard deviation.
    """
    known = {s.group: s for s in fleet.sizes}
    groups = [g for g in dict.fromkeys(robot.groups) if g in known]
    for group in groups:
        own = np.array([g == group for g in robot.groups])
        size = known[group].factor * np.exp(known[group].log_std)
        square = float((robot.value[own] ** 2 / (size**2 + robot.std[own] ** 2)).sum())
        chance = float(chdtrc(own.sum(), square))
        if chance < 1e-3 / len(groups):
            rms = float(np.sqrt((robot.value[own] ** 2).mean()))
            yield Misfit(robot.name, group, rms / known[group].factor, chance)
