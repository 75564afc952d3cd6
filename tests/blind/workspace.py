"""How good a calibrated robot is everywhere: true tool errors over the workspace, beside what the fit states of them.

The arm, its hidden effects and the readings come from ``tests.simulation.generator``, which shares no code with the
planner. The tool is compared at joint states anywhere above the floor, after one rigid alignment of the base, as a cell
aligns its work pieces.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tests.simulation.generator.runs as runs
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files
from planner.kinematics.robot_reader import load_robot
from planner.release.tool_map import moving_effects, tool_map
from planner.tracing.trace import trace
from tests.blind.trial import identified
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.catalogue import KINDS, motions
from tests.simulation.generator.course import course
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import draw_truth

STATES = 500
# what moves the tool at a joint state by itself, inside and outside the catalogue, and largest amplitude [rad] of gears
INSIDE = ("joint-compliance", "encoder-once", "encoder-twice", "reducer-ripple", "backlash-torque", "link-bending")
OUTSIDE = ("gear-uneven", "hose-drag", "link-twist", "soft-floor-xy", "wobble", "sawtooth")
GEAR = (5e-5, 3e-4)
SOFT = (1e-4, 1e-3)  # [rad] at the joint's reference torque
# one sigma of a gauge's scale, which no run tells from the arm's lengths: steel 1 K off; air 1 K off, 1 ppm, and an
# absolute distance meter, as much again (ASME B89.4.19)
SCALE = {"edbb": 1e-5, "tracker": 2e-6}


@dataclass(frozen=True)
class Task:
    """Gauge, name of the plan, how many effects are hidden, whether one of them is in no catalogue, seed."""

    gauge: str
    plan: str
    hidden: int
    outside: bool
    seed: int
    arm: str = "comau-nj130"


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    Attributes:
        nominal, geometry, released, posterior: mean errors of the tool [m]: of the nominal robot, least squares of
            geometry, the robot that is written, and the posterior's mean, whether it is written or not.
        rms, stated: error of the released robot [m], and what the document states.
        geometry_stated: what it states of geometry alone [m].
        covered: share of the coordinates of the tool that lie within their 95 % interval.
        basis: how much of the way from geometry alone to the compromise with the posterior the released robot goes.
    """

    task: Task
    nominal: float = 0.0
    geometry: float = 0.0
    released: float = 0.0
    posterior: float = 0.0
    rms: float = 0.0
    stated: float = 0.0
    geometry_stated: float = 0.0
    covered: float = 0.0
    basis: str = ""
    seconds: float = 0.0
    warned: bool = False
    effects: tuple[Effect, ...] = ()
    found: tuple[str, ...] = ()
    failed: str = ""


def hidden_effects(arm: Arm, rng: np.random.Generator, count: int, outside: bool) -> list[Effect]:
    """Draw effects of random kind, joint and size; no two alike."""
    out: dict[tuple[str, int], Effect] = {}
    while len(out) < count:
        kind = KINDS[str(rng.choice(OUTSIDE if outside and not out else INSIDE))]
        joint = int(rng.choice(kind.places(arm)))
        inner = tuple(sorted((k, float(v)) for k, v in kind.inner(rng, arm, joint).items()))
        scale = 1 / arm.reference_torque(joint) if kind.unit == "rad/Nm" else 1.0
        size = float(np.exp(rng.uniform(*np.log(SOFT if kind.unit == "rad/Nm" else GEAR)))) * scale
        out.setdefault((kind.name, joint), Effect(kind.name, joint, size, inner))
    return list(out.values())


def gauge_scale(task: Task) -> Effect:
    """Draw how far the gauge's scale is off; a gauge whose scale is perfect measures better than any can state."""
    rng = np.random.default_rng([task.seed, 9])
    return Effect("gauge-scale", size=float(SCALE[task.gauge] * rng.standard_normal()))


def try_task(task: Task, measured_q: np.ndarray) -> Outcome:
    """Make the run at the joint angles (n, N) [rad], identify it, and judge the robots over the workspace."""
    arm, bench = Arm.from_toml(task.arm), BENCHES[task.arm]
    rng = np.random.default_rng([task.seed, 8])
    hidden = hidden_effects(arm, rng, task.hidden, task.outside)
    truth = draw_truth(arm, task.seed, [*hidden, gauge_scale(task)])
    made = runs.measured(arm, bench, task.gauge, measured_q, truth, task.seed)
    q = states_anywhere(arm, bench, rng)
    true = true_tool(arm, bench, made.truth, q)
    _, found, seconds = identified(made, trace)
    alone = found.released.geometry  # no stage with effects declared or noted on the way
    geometry = dict(zip(alone.model.names, map(float, alone.errors), strict=True))
    with tempfile.TemporaryDirectory() as folder:
        off = difference(released_tool(found, bench, Path(folder), q), true)
    sigma, shift = expected_difference(found, q)
    mean = lambda x: float(np.linalg.norm(x, axis=1).mean())  # noqa: E731
    return Outcome(
        task,
        mean(difference(arm_tool(arm, bench, {}, q), true)),
        mean(difference(arm_tool(arm, bench, geometry, q), true)),
        mean(off),
        mean(off - shift),
        float(np.sqrt((off**2).sum(axis=1).mean())),
        found.workspace_error,
        found.release.geometry_anywhere,
        float((np.abs(off) <= 1.96 * sigma).mean()),
        f"{found.release.share:.2f}",
        seconds,
        any("workspace" in w or "anywhere" in w for w in found.warnings),
        tuple(hidden),
        tuple(f"{f.effect}, {f.on}" for c in found.findings for f in c.each),
    )


def expected_difference(found, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return σ of the released tool's coordinates by the fit, (n, 3) [m], and how far they are off its mean."""
    robot = found.released
    fit = robot.posterior.fit
    where = tool_map(q, found.run, fit.model.setup, moving_effects(fit), with_point=True)
    shift = where.rows @ robot.offset(where.names, robot.fit)
    return np.sqrt(((where.rows @ robot.spread(where.names)) ** 2).sum(axis=2) + shift**2), shift


def states_anywhere(arm: Arm, bench, rng: np.random.Generator) -> np.ndarray:
    """Draw joint states (STATES, N) within the limits, at most a turn about home, the tool above the floor."""
    home = np.radians(bench.home_deg)
    lower, upper = np.maximum(arm.lower, home - np.pi), np.minimum(arm.upper, home + np.pi)
    q = rng.uniform(lower, upper, (4 * STATES, arm.n_joints))
    return q[arm_tool(arm, bench, {}, q)[:, 2] > 0][:STATES]


def arm_tool(arm: Arm, bench, errors: dict[str, float], q: np.ndarray) -> np.ndarray:
    """Return the tool point (n, 3) [m] of the arm with geometric errors and errors ``map_x`` … of the tool."""
    R, p = arm.flange(q, {k: v for k, v in errors.items() if k in arm.names})
    return p + R @ (bench.tool + [errors.get(f"map_{x}", 0.0) for x in "xyz"])


def true_tool(arm: Arm, bench, truth, q: np.ndarray) -> np.ndarray:
    """Return where the true arm's tool is, effects included, (n, 3) [m]."""
    scene = course(arm, bench, "tracker", q, truth, np.random.default_rng(0), frozenset())
    return scene.points(total(truth.of_arm(arm), motions(scene, truth.effects)))


def released_tool(found, bench, folder: Path, q: np.ndarray) -> np.ndarray:
    """Return the tool of the robot file that is written, (n, 3) [m], with the tool point that was fitted."""
    for name, text in calibrated_files(found):
        (folder / name).write_text(text)
    p, R = CalibratedRobot(load_robot(folder / "robot.toml")).flange(q)
    fitted = dict(zip(found.released.fit.model.names, found.released.fit.errors, strict=True))
    return p + R @ (bench.tool + [fitted.get(f"map_{x}", 0.0) for x in "xyz"])


def difference(x: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return how far points (n, 3) [m] are from others once they are moved rigidly onto them."""
    a, b = x - x.mean(axis=0), true - true.mean(axis=0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return np.asarray(a @ R - b)
