"""Plans made by hand: no search, no collision check, in a fraction of a second."""

import json

import numpy as np

from planner.cell.reading import load_cell, read_cell
from planner.design.candidates.pool import draw_candidates
from tests.not_everywhere import require_planning

ROLES = ("mount", "calibrate", "calibrate", "validate", "calibrate", "repeat", "mount")


def plan_folder(folder, robot="kuka-kr6-r700", fixtures=1, angles=None, roles=ROLES, edit=None, changes=()):
    """Write plan.json and cell.toml for the shipped cell of ``robot``; returns the path of the plan.

    Without ``angles`` (m, N) [deg] it is a few poses near home, the sixth at the place of the second.
    """
    folder.mkdir(parents=True, exist_ok=True)
    cell = cell_in(folder, robot, fixtures, changes)
    poses, drives = [], []
    for k in range(fixtures):
        name, ids = "AB"[k], range(k * len(roles), (k + 1) * len(roles))
        q = near_home(cell, k) if angles is None else angles
        approach = np.sign(np.diff(q, axis=0, prepend=q[:1])).astype(int).tolist()
        poses += [
            {"id": i, "q_deg": list(v), "role": role, "approach": a, "fixture": name}
            for i, v, role, a in zip(ids, q, roles, approach, strict=True)
        ]
        drives.append({"fixture": name, **waypoints(cell, q, ids)})
    plan = {"schema": "edbb-plan/1", "plan_id": "0123456789ab", "poses": poses, "drives": drives}
    if edit is not None:
        edit(plan)
    path = folder / "plan.json"
    path.write_text(json.dumps(plan))
    return path


def cell_in(folder, robot, fixtures, changes):
    """The shipped cell, laid into the folder."""
    text = load_cell(f"{robot}/edbb").path.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    if fixtures == 2:
        text += '\n[[fixtures]]\nname = "B"\nposition_mm = [300, -400, 100]\n'
    (folder / "cell.toml").write_text(text)
    return read_cell(folder / "cell.toml", "cell")


def near_home(cell, seed):
    q = np.rad2deg(cell.home) + np.random.default_rng(5 + seed).uniform(-12, 12, (len(ROLES), cell.robot.n_joints))
    q[-1], q[5] = q[0], q[1]
    return np.clip(q, *np.rad2deg([cell.robot.q_lower + 0.01, cell.robot.q_upper - 0.01]))


def waypoints(cell, q, ids):
    """Travel and measuring path, with a support pose in between."""
    still = cell.motion.measure == "static"
    blend = [0 if still or i in (ids[0], ids[-1]) else 5 for i in ids]
    way = [{"q_deg": list(v), "visit": i, "blend_mm": r} for v, i, r in zip(q, ids, blend, strict=True)]
    support = {"q_deg": list((q[2] + q[3]) / 2 + 1.0), "visit": -1, "blend_mm": 5}
    travel = [{"q_deg": list(v), "visit": -1, "blend_mm": 0} for v in (np.rad2deg(cell.home), q[0])]
    return {"travel": travel, "waypoints": [*way[:3], support, *way[3:]]}


def wide_plan(folder, robot="kuka-kr6-r700", calibrate=60, validate=8, repeat=4, changes=(), mixed=False):
    """A plan over poses that the bar reaches, enough of them to identify the robot.

    They come in rows of one posture turned about axis 1; ``mixed`` shuffles them: those kept out are of all kinds.
    """
    require_planning()
    cell = cell_in(folder, robot, 1, changes)
    q = np.rad2deg(draw_candidates(cell, calibrate + validate + 1).q[: calibrate + validate + 1])
    q = np.random.default_rng(0).permutation(q) if mixed else q
    roles = ["mount", *["calibrate"] * calibrate, *["validate"] * validate, *["repeat"] * repeat, "mount"]
    return plan_folder(folder, robot, angles=np.vstack([q, q[1 : repeat + 1], q[:1]]), roles=roles, changes=changes)


def truth_file(folder, text):
    path = folder / "truth.toml"
    path.write_text('schema = "edbb-truth/1"\n' + text)
    return path
