"""A run held against what the nominal arm and the plan know: its unit, its poses, its places."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.cell.file import FIRST_POINT
from planner.cell.reading import load_cell
from planner.common.determinism import even_positions
from planner.common.errors import InputError, NoSolutionError
from planner.common.files import check_readable
from planner.common.units import Array, to_mm
from planner.gauges.placement.frames import place_frames
from planner.gauges.placement.solver import FlangePoses, flange_poses
from planner.kinematics.robot import Robot
from planner.runs.joint_motion import bring_within_limits
from planner.runs.probe_turns import settle_turns
from planner.runs.run import Run
from planner.session.document import PlanDocument, check_run_of_plan

UNITS = (  # factor to what was meant, what it looks like, what to do
    (1e3, "metres in x_mm, or millimetres in x_um", "call them x_m, y_m, z_m (or x_mm, y_mm, z_mm)"),
    (1e-3, "millimetres in x_m, or micrometres in x_mm", "call them x_mm, y_mm, z_mm (or x_um, y_um, z_um)"),
    (1e6, "metres in x_um", "call them x_m, y_m, z_m"),
    (10.0, "centimetres", "give 10 times the numbers (factor = 10 in a map)"),
    (25.4, "inches", "give 25.4 times the numbers (factor = 25.4 in a map)"),
)


def settle_angles(run: Run, robot: Robot) -> Run:
    """Return a run whose joint angles stand within the robot's limits, and whose probe is turned as fits them.

    Raises:
        InputError: the probe's columns say a convention by which it does not fit.
    """
    return settle_turns(bring_within_limits(run, robot.q_lower, robot.q_upper, robot.slides), robot)


def cell_of_run(cell: Cell | Path | str | None, plan: Path | str | None) -> Cell:
    """Return the cell of a run: the one that is given, else the ``cell.toml`` beside the plan that was measured.

    Raises:
        InputError: neither is given, or the file is wrong.
    """
    if isinstance(cell, Cell):
        return cell
    if cell is None and plan is None:
        raise InputError(
            "which cell was measured in? --plan PLAN.json (in Python plan=) takes the cell.toml beside the plan, "
            "--cell CELL (cell=) any other"
        )
    if cell is None:
        if Path(str(plan)).is_dir():
            check_readable(Path(str(plan)))  # says which file in it is meant: what stands beside a folder is another's
        cell = Path(str(plan)).parent / "cell.toml"
    return load_cell(str(cell), planning=False)


def check_unit(run: Run, cell: Cell) -> None:
    """Refuse positions that fit the arm's movement in another unit, and not as they are.

    A point that hardly moves while the arm turns about it is none of these: it fits as it is.

    Raises:
        InputError: with both movements and the names that the columns should have.
    """
    near_factor = 3.0  # within which a ratio is about the factor of a unit
    if run.readings.position is None:
        return
    few = run.take(even_positions(len(run), 200))  # rows of a run tell its unit
    stand = flange_poses(setup_of(cell), few)
    group = few.samples.place if few.samples.point is None else few.samples.place * len(run.points) + few.samples.point
    read, arm = _spread_rms(np.asarray(few.readings.position), group), _spread_rms(stand.p_BF, group)
    near = [unit for unit in UNITS if 1 / near_factor < read * unit[0] / max(arm, 1e-12) < near_factor]
    tried = [(_placement_rms(few, stand, factor), words, cure) for factor, words, cure in near]
    left, words, cure = min(tried, default=(np.inf, "", ""))
    # 0.1: share of what is left in the unit as written that may be left in the other one
    if near and left < 0.1 * _placement_rms(few, stand, 1.0):
        raise InputError(
            f"{run.name}: the points lie {to_mm(read):.3g} mm from their middle, but the arm moved its flange by "
            f"{to_mm(arm):.3g} mm: these look like {words}; if so, {cure}"
        )


def _spread_rms(p: Array, group: np.ndarray) -> float:
    """Root of the mean square distance of points (n, 3) from the middle of their group (n,) [m]."""
    apart = np.concatenate([p[group == g] - p[group == g].mean(axis=0) for g in np.unique(group)])
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _placement_rms(run: Run, stand: FlangePoses, factor: float) -> float:
    """What no frame and no tool point explain of the positions times a factor, rms [m]."""
    try:
        return place_frames(stand, factor * np.asarray(run.readings.position)).rms
    except (InputError, NoSolutionError):
        return float("inf")


FAR = np.deg2rad(10.0)  # from where the plan has its pose no sample stands that was measured there


def split_by_plan(run: Run, path: Path, plan: PlanDocument, cell: Cell) -> tuple[Run, Run | None]:
    """Return the run without the plan's validation poses, and these.

    Raises:
        InputError: a plan for another robot; a run of another plan, or with rows at other poses than it has.
    """
    check_run_of_plan(run, path, plan, cell.robot.name)
    if run.samples.pose is None:
        return run, None
    aside = np.isin(run.samples.pose, plan.ids("validate"))
    strange = np.setdiff1d(run.samples.pose[run.samples.pose >= 0], plan.ids())
    if len(strange):
        raise InputError(f"{run.name}: pose {strange[0]} is not in {path} (there: 0 … {max(plan.ids())})")
    _check_places(run, path, plan)
    if not run.continuous:
        check_angles(run, path, plan, cell)
    if not aside.any() or aside.all():
        return run, None
    return run.take(~aside), replace(run.take(aside), name=f"{run.name}, validation poses")


def check_angles(run: Run, path: Path, plan: PlanDocument, cell: Cell) -> None:
    """Refuse a run whose samples stand elsewhere than the plan has their poses.

    Raises:
        InputError: naming row, pose and axis, and by how much it may be off.
    """
    from planner.design.candidates.balls import corrected_turns  # collision engines: a run without a plan does without

    assert run.samples.pose is not None
    planned = {p.id: np.deg2rad(p.q_deg) for p in plan.poses if len(p.q_deg) == cell.robot.n_joints}
    rows = [k for k, pose in enumerate(run.samples.pose.tolist()) if pose in planned]
    if not rows:
        return
    q = np.array([planned[pose] for pose in run.samples.pose[rows].tolist()])
    # 4.0: standard deviations of what the arm's errors turn a joint by where its ball is led to a seat, beside FAR
    off, limit = np.abs(run.samples.q[rows] - q), FAR + 4.0 * corrected_turns(cell, q)
    for k, row in enumerate(rows):
        axis = int((off[k] - limit[k]).argmax())
        if off[k, axis] > limit[k, axis]:
            say = cell.robot.joint_text
            driven = "was it read in passing ('# measure: continuous' above the columns says so)? Else "
            passing = driven if cell.motion.is_continuous else ""  # rows of a drive that were thinned look like rests
            raise InputError(
                f"{run.where(row)}: pose {run.samples.pose[row]} was measured with axis {axis + 1} "
                f"{say(axis, off[k, axis], '.1f')} off, by {path} (at most {say(axis, limit[k, axis], '.1f')}"
                f"{_guidance_text(cell)}): {passing}are the poses numbered right, and is the plan the one "
                "that was driven?"
            )


def _guidance_text(cell: Cell) -> str:
    return " by the errors that robot, tool and artifact may have" if cell.gauge.at_balls else ""


def _check_places(run: Run, path: Path, plan: PlanDocument) -> None:
    """Refuse a run that measured a pose elsewhere than the plan has it: at another ball, fixture or tool point."""
    assert run.samples.pose is not None
    planned = {p.id: p for p in plan.poses}
    looks = (
        ("ball", run.readings.ball, run.balls), ("fixture", run.samples.place, run.places),
        ("point", run.samples.point, run.points),
    )  # fmt: skip
    for what, which, names in looks:
        if which is None or names == ("",):
            continue
        pairs, first = np.unique(np.stack([run.samples.pose, which]), axis=1, return_index=True)
        for k, (pose, at) in sorted(zip(first.tolist(), pairs.T.tolist(), strict=True)):
            only = FIRST_POINT if what == "point" else None  # a plan for one point of the tool names none
            wanted = (getattr(planned[pose], what) or only) if pose in planned else None
            if wanted and names[at] and names[at] != wanted:
                raise InputError(
                    f"{run.where(k)}: pose {pose} was measured at {what} '{names[at]}', but {path} has it at '{wanted}'"
                )
