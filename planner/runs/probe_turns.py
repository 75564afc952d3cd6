"""How a probe's three angles, or its quaternion, turn it: as the columns say, tried against the joint angles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.units import Array, read_only, to_deg
from planner.kinematics.geometry import log3, nearest_rotation
from planner.kinematics.robot import Robot
from planner.runs.run import Run

CONVENTIONS: Mapping[str, str] = {  # of rx, ry, rz, as their columns call them, and what they mean
    "moving": "about moving axes, x first",
    "fixed": "about fixed axes, x first (moving ones, z first)",
    "vector": "as a rotation vector",
}
QUATERNION, W_FIRST = "quaternion", "w first"
SAID = {**CONVENTIONS, QUATERNION: "as quaternions of the order x, y, z, w", W_FIRST: "with w before x, y, z"}


def rotations_of(turns: Array, convention: str) -> Array:
    """Return the rotations R_GM (n, 3, 3) of angles (n, 3) [rad], or quaternions x, y, z, w (n, 4)."""
    turns = np.array(turns)  # one that may be written, as scipy asks for
    if convention == QUATERNION:
        return np.asarray(Rotation.from_quat(turns).as_matrix())
    if convention == W_FIRST:
        return np.asarray(Rotation.from_quat(np.roll(turns, -1, axis=1)).as_matrix())
    if convention == "vector":
        return np.asarray(Rotation.from_rotvec(turns).as_matrix())
    return np.asarray(Rotation.from_euler("xyz" if convention == "fixed" else "XYZ", turns).as_matrix())


def settle_turns(run: Run, robot: Robot) -> Run:
    """Return a run whose probe is turned as fits the joint angles, where its columns do not say how, with a note of it.

    Raises:
        InputError: the columns say how, and another convention fits far better; or none fits at all.
    """
    sure = 0.5  # of the error of what is said or usual, below which another convention is the right one
    apart, most = 1e-3, 0.35  # [rad] errors that matter; that no robot has, calibrated or not
    turns, R_GM = run.readings.turns, run.readings.rotation
    if turns is None or R_GM is None or run.samples.q.shape[1] != robot.n_joints:
        return run
    said = run.turns_as or "moving"
    errors = {c: _error(run, robot, rotations_of(turns, c)) for c in _rivals(said)}
    best = min(errors, key=lambda c: errors[c])
    if not np.isfinite(errors[said]):  # too few poses
        return run
    columns = "the quaternions" if said == QUATERNION else "rx, ry, rz"
    fits = f"{columns} turn the probe {SAID[best]}: so they fit the joint angles to {_degrees(errors[best])}"
    wins = errors[best] < sure * errors[said] and errors[said] > apart
    if (run.turns_as and wins) or errors[best] > most:
        why = f"{fits}, " if wins else f"{columns} contradict the joint angles in every convention: "
        cure = f"; call the columns r{{x,y,z}}_{best}_deg" if wins and best in CONVENTIONS else ""
        raise InputError(f"{run.name}: {why}{SAID[said]} only to {_degrees(errors[said])}{cure}")
    if run.turns_as:
        return run
    if wins:
        note = f"{run.name}: {fits}, {SAID[said]} to {_degrees(errors[said])} (rx_{best}_deg … says so)"
        rotation = read_only(rotations_of(turns, best))
        readings = replace(run.readings, rotation=rotation)
        return replace(run, readings=readings, turns_as=best, warnings=(*run.warnings, note))
    if any(errors[c] < errors[said] / sure and _differ(turns, c, said) > apart for c in errors if c != said):
        note = (
            f"{run.name}: whether {columns} turn the probe about moving or fixed axes cannot be told from so small "
            "angles. Moving ones, x first, are taken (rx_moving_deg …, rx_fixed_deg … or rx_vector_deg … says it)"
        )
        return replace(run, warnings=(*run.warnings, note))
    return run


def _rivals(said: str) -> tuple[str, ...]:
    return (QUATERNION, W_FIRST) if said == QUATERNION else tuple(CONVENTIONS)


def _degrees(error: float) -> str:
    return f"{float(to_deg(error)):.2g}°"


def _differ(turns: Array, one: str, other: str) -> float:
    """Return by how much two conventions turn the probe apart, root mean square [rad]."""
    between = np.swapaxes(rotations_of(turns, one), 1, 2) @ rotations_of(turns, other)
    return float(np.sqrt((log3(between) ** 2).sum(axis=1).mean()))


def _error(run: Run, robot: Robot, R_GM: Array) -> float:
    """Return how far probes are turned from where the nominal robot holds them, root mean square [rad].

    How stations stand and how probes sit on the flange is fitted, each pair of them alone; infinite of too few poses.
    """
    fewest = 5  # poses of a station and a probe
    R_BF = np.moveaxis(robot.chain.forward(robot.theta(run.samples.q)).R, 2, 0)
    parts = [_left_of_fit(R_GM[rows], R_BF[rows]) for rows in _mountings(run) if len(rows) >= fewest]
    return float(np.sqrt(np.concatenate(parts).mean())) if parts else np.inf


def _mountings(run: Run) -> Iterator[np.ndarray]:
    pairs = np.stack([run.samples.place, run.samples.point_numbers], axis=1)
    _, number = np.unique(pairs, axis=0, return_inverse=True)
    yield from (np.flatnonzero(number.ravel() == k) for k in range(int(number.max()) + 1))


def _left_of_fit(R_GM: Array, R_BF: Array) -> Array:
    """Return the squares of the angles (n,) [rad²] that R_GB R_BF R_FM leaves of R_GM, R_GB and R_FM being fitted."""
    # the turn from pose to pose is the same turn seen in the probe: its axes tell how the probe sits
    seen, made = (log3(np.swapaxes(R[:-1], 1, 2) @ R[1:]) for R in (R_GM, R_BF))
    R_FM = nearest_rotation(np.einsum("ni,nj->ij", made, seen))
    for _ in range(20):  # each is the best for the other: it comes to rest within a few
        R_GB = nearest_rotation(np.einsum("nij,nkj->ik", R_GM, R_BF @ R_FM))
        R_FM = nearest_rotation(np.einsum("nji,njk->ik", R_GB @ R_BF, R_GM))
    return np.asarray((log3(np.swapaxes(R_GB @ R_BF @ R_FM, 1, 2) @ R_GM) ** 2).sum(axis=1))
