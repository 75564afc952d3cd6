"""A log that runs on while the arm rests at pose after pose: each rest becomes one sample."""

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.runs.joint_motion import REST_SPEED, REST_TIME, find_rests, last_directions
from planner.runs.run import IntArray, Readings, Run, Samples

MEANS = frozenset(
    {"q", "t", "q_cmd", "q_read", "temperature", "force", "torque", "payload", "length", "position", "offset"}
)

T = TypeVar("T", Samples, Readings)


def average_rests(run: Run, speed: float = REST_SPEED, least: float = REST_TIME) -> Run:
    """Return the run with one sample for each stretch at rest: angles, readings and circumstances averaged there.

    The direction in which each joint last moved is noted where the run does not say it. A warning tells how many rests
    there are, and of how many samples.

    Args:
        run: samples that follow each other in time.
        speed: below which a joint rests [rad/s], see `find_rests`.
        least: the shortest rest [s].

    Raises:
        InputError: the run has no time, or the arm rests nowhere.
    """
    stretches = _measured_rests(run.samples, speed, least)
    if len(stretches) == 0:
        raise InputError(
            f"{run.name}: none of {len(run)} samples is at rest (no joint moving by more than "
            f"{np.rad2deg(speed * least):.3f} degrees in {least:g} s); is this a continuous run?"
        )
    count = np.diff(stretches, axis=1)[:, 0]
    samples, readings = _average_stretches(run.samples, stretches), _average_stretches(run.readings, stretches)
    if run.samples.direction is None:
        samples = replace(samples, direction=read_only(last_directions(run.samples.q, stretches[:, 0], speed * least)))
    warning = (
        f"{run.name}: {len(stretches)} rests were found in {len(run)} samples; each is the mean of "
        f"{count.min()} to {count.max()} of them"
    )
    lost = _poses_without_rest(run.samples, samples)
    missing = (f"{run.name}: the arm did not rest at the poses {lost}; they are left out",) if lost else ()
    warnings = (*run.warnings, warning, *missing)
    return replace(run, samples=samples, readings=readings, continuous=False, warnings=warnings)


def marks_rests(run: Run) -> bool:
    """Return whether the numbers of poses in a dense log mark places of rest: the arm stands still in most of them."""
    pose = run.samples.pose
    if pose is None or run.samples.t is None:
        return False
    marked = np.unique(pose[pose >= 0])
    at_rest = np.unique(pose[_measured_rests(run.samples, REST_SPEED, REST_TIME)[:, 0]])
    return len(marked) > 1 and 2 * len(at_rest) >= len(marked)


def _measured_rests(samples: Samples, speed: float, least: float) -> IntArray:
    """Return the rests that are measurements: those with a pose's number where numbers are given, else all."""
    stretches = find_rests(samples, speed, least)
    if samples.pose is None or not (samples.pose >= 0).any():
        return stretches
    return np.asarray(stretches[samples.pose[stretches[:, 0]] >= 0])


def _poses_without_rest(before: Samples, after: Samples) -> str:
    if before.pose is None or after.pose is None:
        return ""
    return ", ".join(str(p) for p in np.setdiff1d(before.pose[before.pose >= 0], after.pose))


def _average_stretches(values: T, stretches: IntArray) -> T:
    """Return one entry for each stretch: the mean of what is measured, the first of what is a number of something."""
    parts = {}
    for name in (f.name for f in fields(values)):
        value = getattr(values, name)
        if value is None:
            continue
        if name == "rotation":
            parts[name] = read_only([Rotation.from_matrix(value[a:b]).mean().as_matrix() for a, b in stretches])
        else:
            kept = _means(value, stretches) if name in MEANS else value[stretches[:, 0]]
            parts[name] = read_only(kept, kept.dtype)
    return replace(values, **parts)


def _means(value: Array, stretches: IntArray) -> Array:
    """Return the mean over each stretch, from differences to its first sample so that no digits are lost."""
    first = value[stretches[:, 0]]
    owner = np.repeat(np.arange(len(stretches)), np.diff(stretches, axis=1)[:, 0])
    rows = np.concatenate([np.arange(a, b) for a, b in stretches])
    away = value[rows] - first[owner]
    starts = np.searchsorted(owner, np.arange(len(stretches)))
    count = np.diff(stretches, axis=1).astype(float)
    return np.asarray(first + np.add.reduceat(away, starts, axis=0) / (count if value.ndim > 1 else count[:, 0]))
