"""A cell of its own, in mm and degrees: an arm, balls off their planned places, a head with tilted indicators.

Shares no code with the planner.
"""

import threading
import time

import numpy as np

# axes and points on them with all joints at 0 [mm]; a six-axis arm of the 700 mm class
AXES = np.array([[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]], float)
POINTS = np.array([[0, 0, 0], [25, 0, 400], [340, 0, 400], [340, 0, 435], [705, 0, 435], [705, 0, 435]], float)
TCP = np.array([900.0, 20.0, 430.0])
FREE = -6.15  # what an indicator shows with nothing before it
REACH = 5.75  # a disk tip of 11.5 mm


def turn(axis, degrees):
    """Rodrigues."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.deg2rad(degrees)
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K


HEAD = turn([0, 1, 0], 35.0) @ turn([1, 0, 0], 20.0)  # how the tool frame is turned at 0


def pose(q):
    """Tool point (3,) [mm] and tool axes (3, 3) in the base."""
    R, p = np.eye(3), np.zeros(3)
    for axis, point, angle in zip(AXES, POINTS, q, strict=True):
        r = turn(axis, angle)
        p = p + R @ (point - r @ point)
        R = R @ r
    return p + R @ TCP, R @ HEAD


def shifted(q, step):
    """Angles after a move of the tool by ``step`` [mm] in its own axes, its orientation kept."""
    p0, R0 = pose(q)
    goal, q = p0 + R0 @ step, np.array(q, float)
    for _ in range(8):
        off = _off(q, goal, R0)
        if np.abs(off).max() < 1e-8:
            break
        J = np.column_stack([(_off(q + 1e-4 * e, goal, R0) - off) / 1e-4 for e in np.eye(6)])
        q = q - np.linalg.solve(J, off)
    return q


def _off(q, goal, R0):
    p, R = pose(q)
    D = R @ R0.T
    return np.concatenate([p - goal, 200.0 * np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])])


class World:
    """Where the arm truly stands, and what the indicators then show.

    ``offsets`` {pose id: ball from the planned tool point, in tool axes [mm]}; ``tilt`` of the indicators [deg];
    ``landing`` scatter of a finished move [mm]; ``ringing`` after a move [mm], gone after some hundredths of a second.
    """

    def __init__(self, plan, offsets, tilt=0.0, noise=0.0, landing=0.0, ringing=0.0, seed=0):
        self.rng = np.random.default_rng(seed)
        self.lock = threading.RLock()
        self.noise, self.landing, self.ringing = noise, landing, ringing
        self.q_set = np.array(plan["drives"][0]["travel"][0]["q_deg"], float)
        self.q = self.q_set.copy()
        self.arrived = -np.inf
        self.balls = {}
        for p in plan["poses"]:
            if "ball" in p:
                x, R = pose(p["q_deg"])
                self.balls[p["id"]] = x + R @ np.asarray(offsets[p["id"]], float)
        self.axes = np.eye(3)  # rows: directions in which the indicators read positive, in tool axes
        for k in range(3):
            across = np.cross(self.axes[k], self.rng.normal(size=3))
            self.axes[k] = turn(across / np.linalg.norm(across), tilt) @ np.eye(3)[k]
        self.jammed = {}  # indicator -> the value at which it stays
        self.scale = np.ones(3)

    def place(self, q_set, q):
        with self.lock:
            self.q_set, self.q = np.array(q_set, float), np.array(q, float)

    def land(self, q_set):
        """Finish a move: the arm lands near where it was sent."""
        scatter = self.rng.normal(size=3) * self.landing
        with self.lock:
            self.place(q_set, shifted(q_set, scatter) if self.landing else q_set)
            self.arrived = time.monotonic()

    def ball(self):
        """The ball in tool axes [mm], the nearest one."""
        x, R = pose(self.q)
        away = np.array([R.T @ (b - x) for b in self.balls.values()])
        return away[np.linalg.norm(away, axis=1).argmin()]

    def shown(self, k):
        """What indicator k shows [mm]."""
        with self.lock:
            if k in self.jammed:
                return self.jammed[k]
            d = self.ball()
            along = self.axes[k] @ d
            touches = np.linalg.norm(d - along * self.axes[k]) < REACH and along > FREE
            if not touches:
                return FREE
            shaking = self.ringing * np.exp((self.arrived - time.monotonic()) / 0.01)
            return self.scale[k] * (along + self.noise * self.rng.normal() + shaking * self.rng.normal())

    def miss(self, row_q):
        """Distance of the tool point from the nearest ball [mm] with the arm at ``row_q`` [deg]."""
        x, _ = pose(row_q)
        return min(np.linalg.norm(b - x) for b in self.balls.values())


Q = np.array(
    [[0, -60, 80, 10, 50, 20], [25, -50, 75, -30, 60, 0], [-30, -55, 85, 40, 40, -50], [10, -70, 95, 0, 70, 90]], float
)


def plan(count=3, plan_id="0123456789ab"):
    """A plan's content: home, then approach, ball, back off, for each pose."""
    home = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0]
    poses, points = [], []
    for k in range(count):
        q = list(Q[k % len(Q)] + [0, 0, 0, 0, 0, 7.0 * (k // len(Q))])
        off = list(np.round(shifted(q, [-30.0, -30.0, -30.0]), 9))
        poses.append({"id": 2 * k + 1, "q_deg": q, "ball": str(k % 4 + 1), "role": "calibrate", "approach": []})
        points += [{"q_deg": off, "visit": -1, "blend_mm": 0}, {"q_deg": q, "visit": 2 * k + 1, "blend_mm": 0}]
        points += [{"q_deg": off, "visit": -1, "blend_mm": 0}]
    mount = {"q_deg": home, "visit": 0, "blend_mm": 0}
    return {
        "schema": "edbb-plan/1",
        "plan_id": plan_id,
        "robot": "kuka-kr6-r700",
        "poses": [{"id": 0, "q_deg": home, "role": "mount", "approach": []}, *poses],
        "drives": [{"fixture": "A", "travel": [mount], "waypoints": [mount, *points, mount]}],
    }
