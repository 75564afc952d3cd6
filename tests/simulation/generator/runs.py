"""Measured runs: a bar at rest and in motion, a tracker, and a point centred in balls."""

from dataclasses import replace

import numpy as np

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.made as made
import tests.simulation.generator.writing as writing
from tests.simulation.generator.benches import BALLS_MM, BENCHES
from tests.simulation.generator.course import course, every_pose
from tests.simulation.generator.made import Made, TrueRun
from tests.simulation.generator.oracle import rms
from tests.simulation.generator.paths import drive, wander
from tests.simulation.generator.poses import (
    at_targets,
    least_norm,
    point,
    point_jacobian,
    shell_points,
    toured,
    uniform,
)
from tests.simulation.generator.scene import total
from tests.simulation.generator.sizing import scale_to
from tests.simulation.generator.station import Station
from tests.simulation.generator.truth import draw_truth

MARGIN = 0.008  # [m] off the bar's ends, as true and nominal lengths differ by millimetres
CONE = np.radians(80.0)  # the bar keeps within this of the upright
EXTRAS = ("command", "direction", "temperature")  # columns that a run may carry though nothing depends on them


def edbb_static(arm, n_poses=300, seed=0, truth=None, repeats=0.1, logs=None) -> Made:
    """A bar read at rest, ``n_poses`` poses in a tour and a part ``repeats`` of them once more.

    ``logs``: optional columns to carry besides those that the effects need; drawn at random when not given.
    """
    bench, rng = BENCHES[arm.name], np.random.default_rng([seed, 2])
    q = toured(arm, _shell(arm, bench, n_poses, rng))
    q, pose = every_pose(q, repeats, rng)
    return _counted(arm, bench, "edbb", q, pose, seed, truth, logs, rng)


def edbb_continuous(arm, n_rows=20_000, seed=0, truth=None, waypoints=60, logs=None) -> Made:
    """A bar read in motion, through the shell and back again, ``n_rows`` samples evenly in time."""
    bench, rng = BENCHES[arm.name], np.random.default_rng([seed, 3])
    lengths = np.array(bench.length_mm) / 1e3 + [MARGIN, -MARGIN]
    start = _shell(arm, bench, 1, rng)[0]
    q = wander(arm, start, waypoints, bench.fixture, bench.tool, lengths, rng)
    t, q, speed = drive(arm, q, bench.fixture, bench.tool, lengths, n_rows)
    return _counted(arm, bench, "edbb", q, np.arange(n_rows), seed, truth, logs, rng, (t, speed))


def tracker(arm, n_poses=300, seed=0, truth=None, repeats=0.0, logs=None) -> Made:
    """Positions in a tracker's frame, poses all over the joint limits above the floor."""
    bench, rng = BENCHES[arm.name], np.random.default_rng([seed, 4])
    q = uniform(arm, 6 * n_poses, rng)
    x = point(arm, q, bench.tool)
    q = q[(x[:, 2] > 0.05) & (np.hypot(x[:, 0], x[:, 1]) > 0.15)][:n_poses]
    q, pose = every_pose(toured(arm, q), repeats, rng)
    return _counted(arm, bench, "tracker", q, pose, seed, truth, logs, rng)


def measured(arm, bench, gauge, q, truth, seed=0, logs=None) -> Made:
    """A bar or a tracker at given poses q (n, N), in the order given."""
    rng = np.random.default_rng([seed, 6])
    return _counted(arm, bench, gauge, q, np.arange(1, len(q) + 1), seed, truth, logs, rng)


def balls(arm, n_poses=80, seed=0, truth=None, logs=None, bench=None) -> Made:
    """The measured point centred in one of four balls, in turn; recorded are the joint angles of the true arm."""
    bench, rng = bench or BENCHES[arm.name], np.random.default_rng([seed, 5])
    centres = _plate(bench, rng)
    which = np.arange(n_poses) * len(centres) // n_poses
    q = at_targets(arm, centres[which], bench.tool, rng, lambda q: _upright(arm, q, bench), tries=40)
    ok = ~np.isnan(q[:, 0])
    return _in_balls(arm, bench, q[ok], which[ok], centres, seed, truth, logs, rng)


def centred(arm, bench, q, which, truth, seed=0, logs=None) -> Made:
    """The measured point centred in the balls ``which`` (n,) from near the poses q (n, N), in the order given."""
    rng = np.random.default_rng([seed, 7])
    return _in_balls(arm, bench, q, which, _plate(bench, rng), seed, truth, logs, rng)


def _in_balls(arm, bench, q, which, centres, seed, truth, logs, rng):
    truth = truth or draw_truth(arm, seed)
    scene = course(arm, bench, "balls", q, truth, rng, _needed(truth, logs))
    station = Station("balls", np.zeros(3), np.eye(3), balls=centres[which])
    noise = _noise(scene, truth, rng)
    wanted = truth
    for _ in range(2):  # where the arm comes to stand depends a little on its effects, and their sizes on that
        truth = _sized(scene, station, wanted, noise)
        scene, clean, reading = _centred(scene, station, truth, noise)
    run = TrueRun(truth, scene, station, reading, clean, np.arange(1, len(q) + 1))
    return _with_files(run, bench, which, _shown(truth, logs, rng))


def _counted(arm, bench, gauge, q, pose, seed, truth, logs, rng, motion=None):
    """A run whose gauge gives numbers: course, sizes of the effects, readings, noise, files."""
    truth = truth or draw_truth(arm, seed)
    scene = course(arm, bench, gauge, q, truth, rng, _needed(truth, logs), motion)
    station = _station(gauge, scene, truth, rng)
    noise = _noise(scene, truth, rng)
    truth = _sized(scene, station, truth, noise)
    clean = made.with_effects(scene, station, truth, truth.effects)
    k = clean.shape[1]
    reading = clean + _joint_part(scene, station, truth, noise[0]) + truth.noise.gauge * noise[1][:, :k]
    return _with_files(TrueRun(truth, scene, station, reading, clean, pose), bench, None, _shown(truth, logs, rng))


def _with_files(run, bench, ball, shown):
    """The run with its text, that of the cell and, where the shipped one will not do, of the robot."""
    arm, ratios = run.scene.arm, "ratios" in shown
    robot = "robot.toml" if ratios else arm.name
    cell = writing.cell_toml(arm, bench, run.scene.gauge, run.truth.noise.gauge, run.scene.moving, robot)
    table = writing.run_csv(run.scene, run.reading, run.pose, ball, shown)
    own = writing.robot_toml(arm) if ratios else ""
    return Made(**vars(run), run_csv=table, cell_toml=cell, robot_toml=own)


def _shell(arm, bench, count, rng):
    lengths = np.array(bench.length_mm) / 1e3 + [MARGIN, -MARGIN]
    found = np.zeros((0, arm.n_joints))
    while len(found) < count:
        targets = shell_points(bench.fixture, lengths, count, rng, CONE)
        q = at_targets(arm, targets, bench.tool, rng)
        found = np.concatenate([found, q[~np.isnan(q[:, 0])]])
    return found[:count]


def _upright(arm, q, bench):
    """Whether the tool comes from above or from aside: no ball is probed through the plate."""
    R, _ = arm.flange(q)
    out = R @ (bench.tool / np.linalg.norm(bench.tool))
    return out[:, 2] < 0.3


def _plate(bench, rng):
    """Ball centres (4, 3) [m] in the base frame; the plate stands a little turned and off its stated place."""
    turn = rng.normal(0.0, 0.03, 3)
    centres = np.array(BALLS_MM) / 1e3
    angle = np.linalg.norm(turn)
    u = turn / angle
    c, s = np.cos(angle), np.sin(angle)
    turned = c * centres + s * np.cross(u, centres) + (1 - c) * np.outer(centres @ u, u)
    return turned + np.array(bench.plate_mm) / 1e3 + rng.normal(0.0, 3e-3, 3)


def _station(gauge, scene, truth, rng):
    if gauge == "edbb":
        return Station("edbb", scene.fixture, np.eye(3), truth.errors.get("zero", 0.0))
    yaw = rng.uniform(-np.pi, np.pi)
    R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return Station("tracker", np.append(rng.uniform(-3, 3, 2), rng.uniform(0.5, 1.5)), R)


def _noise(scene, truth, rng):
    """Joint (n, N) and gauge (n, 3) noise of unit variance."""
    n, memory = len(scene.t), None
    if scene.moving:
        memory = float(np.exp(-np.median(np.diff(scene.t)) / truth.noise.wander_s))
    return truth.noise.draw(rng, n, scene.arm.n_joints, memory), truth.noise.draw(rng, n, 3)


def _joint_part(scene, station, truth, unit):
    """What the joints' repeatability adds to the reading, (n, k) [m]."""
    off = truth.noise.joint * unit
    moved = {f"theta{i + 1}": off[:, i] for i in range(off.shape[1])}
    still = truth.of_arm(scene.arm)
    return station.read(scene.points(total(still, moved))) - station.read(scene.points(still))


def _sized(scene, station, truth, noise):
    """The truth with every effect at the size that its share asks for."""
    if not any(e.share for e in truth.effects):
        return truth
    k = 1 if station.kind == "edbb" else 3
    total_noise = _joint_part(scene, station, truth, noise[0]) + truth.noise.gauge * noise[1][:, :k]
    level = rms(total_noise)
    effects = [scale_to(e.share, e, scene, station, truth, level) if e.share else e for e in truth.effects]
    return replace(truth, effects=tuple(effects))


def _centred(scene, station, truth, noise):
    """Joint angles at which the true arm's point is in the balls, and the point they stand for without, with noise."""
    for _ in range(12):
        clean = scene.points(total(truth.of_arm(scene.arm), catalogue.motions(scene, truth.effects)))
        part = _joint_part(scene, station, truth, noise[0]) + truth.noise.gauge * noise[1]
        gap = station.balls - (clean + part)
        if np.max(np.abs(gap)) < 1e-10:
            return scene, clean, station.balls
        _, J = point_jacobian(scene.arm, scene.q, scene.tool)
        step = least_norm(J, gap)
        scene = replace(scene, q=scene.q + step, command=scene.command + step)
    raise ValueError("the point could not be centred in its ball")


def _needed(truth, logs):
    return catalogue.logs(truth.effects) | frozenset(logs or ())


def _shown(truth, logs, rng):
    chance = [name for name in EXTRAS if rng.random() < 0.5]
    return _needed(truth, logs) | frozenset(chance if logs is None else ())
