"""Made-up calibrations: any errors on any robot, with the tables that the fit would have made of them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import Targets
from planner.effects.compliance import compliance_parameters
from planner.effects.effect import Parameter, robot_parameters, transform_move
from planner.fit.identifiable_parameters import estimate_parameters
from planner.fit.least_squares import Fit, Solution
from planner.gauges.tracker import Tracker
from planner.kinematics.robot_reader import load_robot
from planner.model.gauge_frames import GaugeFrames
from planner.model.model import Model
from planner.runs.run import Samples
from tests.cell.test_robots import urdf_text

PANDA = Path(__file__).resolve().parents[2] / "data" / "panda-ball" / "panda.urdf"
SLANTED = ["0.6 0 0.8", "0 1 1", "0 0 1", "0 -1 0", "-1 0 0", "0 0 1"]
TILT = np.array([0.3, -0.2, 0.7])  # of the base [rad]
COM = np.array([0.02, -0.03, 0.11])  # of the tool [m]
MASS = 4.0  # of the tool [kg]


def gravity(tilt):
    """Gravity in the axes of a base that is turned by ``tilt`` (roll, pitch, yaw), written out."""
    r, p, _ = tilt
    return -9.80665 * np.array([-np.sin(p), np.sin(r) * np.cos(p), np.cos(r) * np.cos(p)])


def setup_at_flange(robot):
    one = np.ones(1)
    eye, zero = np.eye(3)[None], np.zeros((1, 3))
    return MeasurementSetup(
        robot=robot, gravity_B=gravity(TILT), tool_mass=MASS, com_F=COM, gauge=Tracker(noise=1e-6, noise_angle=1e-6),
        p_BX=zero, R_BG=eye, p_BG=zero, p_FM=zero, R_FM=eye, p_GS=zero, place_names=("",), point_names=("",),
        place_prior=one, tool_prior=1.0, turn_prior=1.0, joint_sigma=0.0,
    )  # fmt: skip


def calibration(robot, seed, effects=()):
    """A calibration with random errors of all geometry (1 mm, 1 mrad) and of every effect (its prior sigma)."""
    setup = setup_at_flange(robot)
    every = [*robot_parameters(setup), *effects]
    errors = np.random.default_rng(seed).normal(size=len(every)) * [p.prior for p in every]
    model = Model(setup, tuple(every))
    fit = Fit(SimpleNamespace(model=model), Solution(errors, np.eye(len(errors)), 0.0), 0.0, np.zeros(0, dtype=int))
    groups = tuple(dict.fromkeys(p.group for p in effects))
    run = type("Made", (), {"name": "monday.csv", "__len__": lambda self: 40})()
    stages = (SimpleNamespace(effects=groups),)
    made = SimpleNamespace(run=run, fit=fit, setup=setup, stages=stages, released=None, release=None)
    made.frames, made.simulated, made.reason_not_to_use = GaugeFrames(), None, ""
    made.estimates = estimates_of(made)
    return made


def estimates_of(calibration):
    """The table of parameters, as identification makes it."""
    return estimate_parameters(calibration.fit.model, calibration.fit, (), np.eye(len(calibration.fit.errors)))


def compliances(robot):
    return compliance_parameters(setup_at_flange(robot))


def predicted(calibration, q):
    """The flange as the fitted model itself has it, (n, 3) [m]."""
    model = calibration.fit.model
    at_base = Targets(position=np.zeros((len(q), 3)))
    return -model.residual(Samples(q, np.zeros(len(q), dtype=int)), at_base, calibration.fit.errors)


def poses(robot, n=50, seed=5):
    return np.random.default_rng(seed).uniform(robot.q_lower, robot.q_upper, (n, robot.n_joints))


def robot_called(name, folder):
    """A shipped robot, ``panda.urdf`` (the arm of the measured runs), or ``slanted``: axes of all directions."""
    if name == "panda.urdf":
        return load_robot(str(PANDA), tip="ball_link")
    if name == "slanted":
        (folder / "slanted.urdf").write_text(urdf_text(SLANTED))
        return load_robot(str(folder / "slanted.urdf"))
    return load_robot(name)


def parameter(robot, name, unit, on, phi, group="made"):
    return Parameter(name, unit, 1e-3, name, transform_move(setup_at_flange(robot).chain.index(on), phi), group)


def write(folder, files):
    for name, text in files:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
