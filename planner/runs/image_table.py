"""The run of images: corners of each by its pose's number, joint angles from a table beside the images."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.kinematics.axes import MODEL
from planner.kinematics.axes_line import KEY as AXES_OF
from planner.runs.quantities import joint_angles
from planner.runs.run import Readings, Run, Samples
from planner.runs.table import read_table


def run_of_images(path: Path, poses: Sequence[int], pixels: Array) -> tuple[Run, tuple[int, ...]]:
    """Return the run of images whose joint angles stand in a table, and the poses of which the table has none.

    Args:
        path: of the table: a row a pose, with its number in ``pose`` and the angles ``q1_deg`` … or ``cmd1_deg`` ….
        poses: number of each image's pose, (n,).
        pixels: corners, (n, K, 2) [px].

    Raises:
        InputError: the table lacks a column, has a pose twice, or none of the images' poses.
    """
    most_joints = 32  # columns of angles that are looked for
    table = read_table(path, most_joints)
    if not table.has("pose"):
        raise InputError(f"{path}: the column 'pose' is missing, by whose number an image finds its joint angles")
    if table.notes.get(AXES_OF, MODEL) != MODEL:
        raise InputError(f"{path}: the angles are of a controller's axes ({AXES_OF}); bring them in by a map first")
    rows = dict[int, int]()
    for row, pose in enumerate(table.array("pose").tolist()):
        if int(pose) in rows:
            raise table.source.error(row, "pose", f"pose {int(pose)} stands twice; an image would find two places")
        rows[int(pose)] = row
    there = [k for k, pose in enumerate(poses) if pose in rows]
    missing = tuple(pose for pose in poses if pose not in rows)
    if not there:
        raise InputError(f"{path}: has none of the images' poses ({_listing(poses)}); it has {_listing(sorted(rows))}")
    which = np.array([rows[poses[k]] for k in there])
    q, n = {}, table.n_joints
    for stem in ("q", "cmd"):
        q[stem] = joint_angles(table, stem, n)
    angles = q["q"] if q["q"] is not None else q["cmd"]
    if angles is None:
        raise InputError(f"{path}: there are no joint angles; q1_deg … as read or cmd1_deg … as commanded are needed")
    read, told = (None if v is None else read_only(v[which]) for v in (q["q"], q["cmd"]))
    samples = Samples(
        q=read_only(angles[which]),
        place=read_only(np.zeros(len(which)), np.int64),
        q_read=read,
        q_cmd=told,
        pose=read_only([poses[k] for k in there], np.int64),
        seen=read_only(~np.isnan(pixels[there][..., 0]), bool),
    )
    notes = table.notes
    run = Run(
        table.stem, samples, Readings(pixels=read_only(pixels[there])), plan_id=notes.get("plan_id"),
        robot=notes.get("robot"), warnings=table.warnings, slides=table.slides,
    )  # fmt: skip
    return run, missing


def _listing(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:5])) + (" …" if len(numbers) > 5 else "")
