"""Position errors of a calibrated robot at poses that no instrument measured."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import tests.simulation.generator.catalogue as catalogue
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files
from planner.kinematics.robot_reader import load_robot
from tests.reproduction.instruments import CHOSEN, REGISTERED, VALIDATED, arm, bench
from tests.reproduction.planned import of_tracker, stops
from tests.reproduction.truth import TRACKER_M, errors, signed_compliances, truth
from tests.simulation.generator.course import course
from tests.simulation.generator.scene import total


@dataclass(frozen=True)
class Errors:
    """Errors (n,) [m] at the validation poses."""

    of: np.ndarray

    @property
    def row(self):
        """Mean, maximum and standard deviation [mm], as in Table 9."""
        return tuple(1e3 * f(self.of) for f in (np.mean, np.max, np.std))


def validation(tool, more=()):
    """Joint angles (n, N) and where the true arm's point ``tool`` (3,) [m] stands there, (n, 3) [m].

    They are the planner's own: random, free of collisions, the reflector in sight. The last ones register.
    """
    (stop,) = stops(of_tracker(CHOSEN, VALIDATED + REGISTERED), "validate")
    a, b = arm(), replace(bench(stop), map_mm=tuple(float(v) for v in np.round(1e3 * tool, 6)))
    what = truth(TRACKER_M, more)
    scene = course(a, b, "tracker", stop.q, what, np.random.default_rng(99), frozenset())
    x = scene.points(total(what.of_arm(a), catalogue.motions(scene, what.effects)))
    order = np.random.default_rng(98).permutation(len(stop.q))
    return stop.q[order], x[order]


def validated(calibration, measured, more=()):
    """Errors of the calibrated robot, as a user would load it, in a frame that other poses placed."""
    q, x = validation(measured.tool, more)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in calibrated_files(calibration):
            (Path(folder) / name).write_text(text)
        robot = CalibratedRobot(load_robot(str(Path(folder) / "robot.toml")))
    p, R = robot.flange(q)
    return Errors(in_frame(p + R @ calibration.frames.tool[0].p_FM, x))


def as_planted(calibration):
    """Joint χ² of the parameters that the fit and Table 8 have in common, and how many they are.

    Where the parallel axes 2 and 3 leave their offsets to one number, that is d2 here and d3 there unless the fit kept
    the paper's; a last row's d6 and θ6 may be the tool point's, and the base's six numbers are those of another frame.
    """
    truth = dict(errors()) | {f"compliance{j}": float(np.radians(c)) for j, c in signed_compliances().items()}
    names = calibration.fit.model.names
    if "d3" not in names:
        truth["d2"] = truth.pop("d3")
    which = [k for k, name in enumerate(names) if name in truth]
    off = calibration.fit.errors[which] - np.array([truth[names[k]] for k in which])
    return float(off @ np.linalg.solve(calibration.covariance[np.ix_(which, which)], off)), len(which)


def in_frame(p, x):
    """Distances (n,) between p and x (n, 3) once the last poses have laid one frame on the other (Kabsch 1976)."""
    a, b = p[VALIDATED:], x[VALIDATED:]
    U, _, V = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    R = U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V
    moved = (p - a.mean(0)) @ R.T + b.mean(0)
    return np.linalg.norm(moved - x, axis=1)[:VALIDATED]
