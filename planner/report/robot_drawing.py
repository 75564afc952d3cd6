"""A robot from the side, with its lengths in mm, as data sheets draw it: upper arm upright, forearm level."""

from itertools import pairwise, product

import numpy as np
from scipy.spatial import ConvexHull

from planner.common.units import Array, to_deg, to_mm
from planner.kinematics.robot import Robot
from planner.report.cell_view import body_mesh

LEAST_MM = 0.5  # [mm] a shorter step between two axes is no length of a data sheet
MARGIN_MM = 90.0  # [mm] room for the numbers beside the arm
STYLE = (
    "text{font:22px sans-serif;fill:#111} .body{fill:#ddd;stroke:#999} .arm{fill:none;stroke:#111;stroke-width:5}"
    " .axis{fill:#fff;stroke:#111;stroke-width:3} .size{stroke:#06c;stroke-width:2} .number{fill:#06c}"
)


def draw_robot(robot: Robot) -> str:
    """Return an SVG of the robot from the side (base x and z), 1 unit = 1 mm, with each step between axes."""
    q = data_sheet_pose(robot)
    points = axis_points(robot, q)[:, [0, 2]]
    outlines = _outlines(robot, q)
    everything = np.vstack([points, *outlines])
    low, high = everything.min(axis=0) - MARGIN_MM, everything.max(axis=0) + MARGIN_MM
    width, height = high - low
    angles = ", ".join(f"{v:.0f}" for v in to_deg(q))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height + 60:.0f}">',
        f"<style>{STYLE}</style><title>{robot.name} from the side</title>",
        f'<g transform="translate({-low[0]:.1f} {high[1]:.1f}) scale(1 -1)">',
        *(f'<polygon class="body" points="{_join(outline)}"/>' for outline in outlines),
        f'<polyline class="arm" points="{_join(points)}"/>',
        *(f'<circle class="axis" cx="{x:.1f}" cy="{z:.1f}" r="9"/>' for x, z in points),
        "</g>",
        *_sizes(points, low, high),
        f'<text x="10" y="{height + 25:.0f}">mm; joints of the model at [{angles}] degrees</text>',
        f'<text x="10" y="{height + 50:.0f}">from base to flange, every step between two axes is one length</text>',
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def data_sheet_pose(robot: Robot) -> Array:
    """Return the joint angles (N,) [rad], in steps of 90°, with the highest elbow and then the farthest flange."""
    lower, upper = robot.one_turn
    start = np.clip(np.zeros(robot.n_joints), lower, upper)
    turning = [k for k in range(1, min(robot.n_joints, 5)) if not robot.slides[k]]
    quarter = np.pi / 2
    choices = [[v for v in quarter * np.arange(-2, 3) if lower[k] <= v <= upper[k]] or [start[k]] for k in turning]
    q = np.array([start] * int(np.prod([len(c) for c in choices])))
    q[:, turning] = list(product(*choices))
    stand = robot.chain.forward(robot.theta(q))
    elbow = stand.p[robot.chain.joint_places[min(2, robot.n_joints - 1)], 2]
    beside = np.abs(stand.x[1])
    # first the elbow, then the reach; of equal poses the one nearest to zero: one file, one drawing
    score = 100 * elbow + stand.x[0] - 10 * beside - 1e-3 * np.abs(q).sum(axis=1)
    return np.asarray(q[int(np.argmax(np.round(score, 9)))])


def axis_points(robot: Robot, q: Array) -> Array:
    """Return base, the place of each joint's frame and the flange at joint angles (N,), points (N + 2, 3) [mm]."""
    stand = robot.chain.forward(robot.theta(q[None]))
    joints = stand.p[robot.chain.joint_places][:, :, 0]
    return np.asarray(to_mm(np.vstack([np.zeros(3), joints, stand.x[:, 0]])))


def lengths(robot: Robot) -> list[tuple[float, float]]:
    """Return the steps between the axes in the drawing, (forward, up) [mm], those of no length left out."""
    points = axis_points(robot, data_sheet_pose(robot))[:, [0, 2]]
    steps = [b - a for a, b in pairwise(points)]
    return [(float(x), float(z)) for x, z in steps if max(abs(x), abs(z)) >= LEAST_MM]


def _outlines(robot: Robot, q: Array) -> list[Array]:
    """Return the outline (k, 2) [mm] of each body from the side."""
    frames = robot.chain.frames(robot.theta(q[None]), sorted(set(robot.link_end)))
    by_end = dict(zip(sorted(set(robot.link_end)), frames, strict=True))
    outlines = []
    for link, body in robot.bodies:
        R, p = by_end[robot.link_end[link]]
        vertices = body_mesh(body).vertices @ R[:, :, 0].T + p[:, 0]
        flat = np.asarray(to_mm(vertices))[:, [0, 2]]
        outlines.append(flat[ConvexHull(flat).vertices])
    return outlines


def _sizes(points: Array, low: Array, high: Array) -> list[str]:
    """Return the dimensions beside the arm: each step's part upwards at the left, forwards at the bottom."""
    lines, left, bottom = [], -low[0] - 45.0, high[1] - low[1] - 45.0
    for (xa, za), (xb, zb) in pairwise(points):
        if abs(zb - za) >= LEAST_MM:
            ya, yb, at = high[1] - za, high[1] - zb, xb - low[0]
            lines.append(f'<line class="size" x1="{at:.1f}" y1="{ya:.1f}" x2="{at:.1f}" y2="{yb:.1f}"/>')
            x, y = max(at + 12, left), (ya + yb) / 2 + 8
            lines.append(f'<text class="number" x="{x:.1f}" y="{y:.1f}">{abs(zb - za):.4g}</text>')
        if abs(xb - xa) >= LEAST_MM:
            y, ends = min(high[1] - min(za, zb) + 40, bottom), (xa - low[0], xb - low[0])
            lines.append(f'<line class="size" x1="{ends[0]:.1f}" y1="{y:.1f}" x2="{ends[1]:.1f}" y2="{y:.1f}"/>')
            lines.append(f'<text class="number" x="{sum(ends) / 2 - 18:.1f}" y="{y - 6:.1f}">{abs(xb - xa):.4g}</text>')
    return lines


def _join(points: Array) -> str:
    return " ".join(f"{x:.1f},{z:.1f}" for x, z in points)
