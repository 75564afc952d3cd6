"""From a calibration to the files of the calibrated robot."""

from collections.abc import Iterator
from pathlib import PurePath

import numpy as np

from planner.effects.keys import is_static, of_gauge
from planner.identification import Calibration
from planner.rig import HEAD, Rig
from planner.robot.model import Loads, RobotEffect
from planner.robot.writing import Corrections, mesh_files, robot_files
from planner.units import Array, frozen


def calibrated_files(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    """Return name and text of ``robot.toml`` and, for a robot given as URDF, of the corrected ``robot.urdf``.

    The geometry goes into the kinematic rows (or the URDF's origins), effects of the robot into ``[[effects]]`` and
    the loads that they were found under into ``[loads]``; what belongs to the gauge stays out. All else is as it was.

    Raises:
        InputError: the robot's own file can no longer be read.
    """
    robot = calibration.fit.model.rig.robot
    effects = tuple(_effects(calibration))
    loads = _loads(calibration.fit.model.rig) if effects else None
    return robot_files(robot, Corrections(tuple(_geometry(calibration)), effects, loads, _source(calibration)))


def calibrated_meshes(calibration: Calibration) -> tuple[tuple[str, bytes], ...]:
    """Return name (``meshes/…``) and content of the collision meshes that :func:`calibrated_files` refers to."""
    return mesh_files(calibration.fit.model.rig.robot)


def _geometry(c: Calibration) -> Iterator[tuple[str, float]]:
    for e in c.estimates:
        if e.group == "geometry" and e.value != e.nominal:
            yield e.name, e.value


def _effects(c: Calibration) -> Iterator[RobotEffect]:
    """Effects on the base and the robot; a parameter that moves several transforms gives one entry for each."""
    chain, model = c.fit.model.rig.chain, c.fit.model
    end = HEAD + len(model.rig.robot.transforms)
    for p, value in zip(model.parameters, c.fit.errors, strict=True):
        for move in p.moves if p.group not in ("gauge", "geometry") else ():
            key = move.phi.key
            if move.on == "transform" and move.index < end and not of_gauge(key):
                on = chain.transforms[move.index].name
                yield RobotEffect(p.name, on, key, float(value), p.unit, is_static(key))


def _loads(rig: Rig) -> Loads:
    """Tool and base of a rig; gravity does not tell the base's turn about the vertical, which is left at zero."""
    return Loads(rig.tool_mass, frozen(rig.com_F), frozen(_tilt(rig.gravity_B)))


def _tilt(gravity_B: Array) -> Array:
    up = -gravity_B / np.linalg.norm(gravity_B)
    return np.array([np.arctan2(up[1], up[2]), np.arctan2(-up[0], np.hypot(up[1], up[2])), 0.0])


def _source(c: Calibration) -> str:
    effects = [g for g in c.stages[-1].effects if g not in ("gauge", "geometry")]
    what = "; ".join(["geometry", *effects])  # their names have commas inside
    return f"Identified from {PurePath(c.run.name).name}, {len(c.run)} samples: {what}."
