"""Effects inside one joint: encoder, gears, bearing, play, and how the angle is read."""

import numpy as np
from scipy.interpolate import CubicSpline

from tests.simulation.generator.benches import RATIOS
from tests.simulation.generator.kinds import Kind

TAU = 2 * np.pi


def _wave(turns):
    def moves(scene, e):
        return {f"theta{e.joint}": e.size * np.sin(turns * scene.joint(e.joint) + e["phase"])}

    return moves


def _ripple(scene, e):
    return {f"theta{e.joint}": e.size * np.sin(e["frequency"] * scene.joint(e.joint) + e["phase"])}


def _sawtooth(scene, e):
    turn = (e["frequency"] * scene.joint(e.joint) + e["phase"]) / TAU
    return {f"theta{e.joint}": e.size * 2 * (turn - np.floor(turn) - 0.5)}


def _line(e, angle):
    """A smooth line through random knots, the same every turn."""
    knots = np.linspace(0, TAU, int(e["knots"]) + 1)
    heights = np.random.default_rng(int(e["seed"])).normal(size=len(knots))
    heights[-1] = heights[0]
    return CubicSpline(knots, heights, bc_type="periodic")(np.mod(angle, TAU))


def _uneven(scene, e):
    """A gear that runs unevenly in no single period."""
    return {f"theta{e.joint}": e.size * _line(e, scene.joint(e.joint))}


def _dragged(scene, e):
    """Hoses that pull at a joint, by the angle of another one far from it."""
    return {f"theta{e.joint}": e.size * _line(e, scene.joint(int(e["by"])))}


def _ratio(scene, e):
    return {f"theta{e.joint}": e.size * scene.joint(e.joint)}


def _coupling(scene, e):
    return {f"theta{e.joint}": e.size * scene.joint(int(e["by"]))}


def _backlash(scene, e):
    return {f"theta{e.joint}": 0.5 * e.size * scene.direction[:, e.joint - 1]}


def _backlash_torque(scene, e):
    return {f"theta{e.joint}": 0.5 * e.size * np.sign(scene.moments(f"theta{e.joint}"))}


def _hysteresis(scene, e):
    """Friction on a spring: over ``width`` of travel the lag turns gradually from one side to the other."""
    q, state = scene.joint(e.joint), np.zeros(len(scene.q))
    for k, dq in enumerate(np.diff(q), 1):
        state[k] = min(1.0, max(-1.0, state[k - 1] + 2 * dq / e["width"]))
    return {f"theta{e.joint}": e.size * state}


def _unsettled(scene, e):
    gap = scene.command - scene.q
    return {f"theta{i + 1}": e.size * gap[:, i] for i in range(gap.shape[1])}


def _lag(scene, e):
    return {f"theta{e.joint}": -e.size * scene.speed[:, e.joint - 1]}


def _wobble(scene, e):
    angle = e["turns"] * scene.joint(e.joint) + e["phase"]
    return {f"tilt_x{e.joint}": e.size * np.cos(angle), f"tilt_y{e.joint}": e.size * e["oval"] * np.sin(angle)}


def _phase(rng, arm, joint):
    return {"phase": rng.uniform(0, TAU)}


def _tone(rng, arm, joint):
    return {"phase": rng.uniform(0, TAU), "frequency": np.round(rng.uniform(2.6, 30.0), 3)}


def _strain_wave(rng, arm, joint):
    """The wave generator of a strain-wave gear runs over the teeth twice in each of its turns."""
    return {"frequency": 2 * RATIOS[joint - 1], **_phase(rng, arm, joint)}


def _by(rng, arm, joint):
    """The axis whose motor also drives this one: a neighbour, as in hands and behind parallelograms."""
    return {"by": float(rng.choice([k for k in (joint - 1, joint + 1) if 1 <= k <= arm.n_joints]))}


def _oval(rng, arm, joint):
    return {"turns": float(rng.integers(1, 4)), "oval": rng.uniform(-1, 1), **_phase(rng, arm, joint)}


MICRO = (2e-5, 1e-3)  # [rad]
KINDS = (
    Kind("encoder-once", "rad", MICRO, _wave(1), joints="all", inner=_phase, right=("encoder-1", "encoder")),
    Kind("encoder-twice", "rad", MICRO, _wave(2), joints="all", inner=_phase, right=("encoder-2", "encoder")),
    Kind("reducer-ripple", "rad", MICRO, _ripple, joints="all", inner=_tone, right=("gear-ripple", "harmonic")),
    Kind(
        "strain-wave", "rad", MICRO, _ripple, joints="all", inner=_strain_wave, logs=("ratios",),
        right=("reducer-ripple", "gear-ripple", "harmonic"),
    ),
    Kind("reduction-ratio", "rad/rad", (2e-5, 2e-3), _ratio, joints="all"),
    Kind("coupling", "rad/rad", (2e-5, 2e-3), _coupling, joints="all", inner=_by),
    Kind(
        "backlash-speed", "rad", MICRO, _backlash, joints="all", motion=("continuous",),
        right=("backlash", "backlash-approach"),
    ),
    Kind(
        "backlash-approach", "rad", MICRO, _backlash, joints="all", motion=("static",), logs=("direction",),
        right=("backlash", "backlash-speed"),
    ),
    Kind("backlash-torque", "rad", MICRO, _backlash_torque, joints="loaded", right=("backlash",)),
    Kind("unsettled", "1", (0.05, 1.0), _unsettled, motion=("static",), logs=("command",)),
    Kind(
        "servo-lag", "s", (5e-5, 2e-2), _lag, joints="all", motion=("continuous",), gauges=("edbb", "tracker"),
        right=("lag",),
    ),
    Kind(
        "hysteresis", "rad", MICRO, _hysteresis, joints="all", in_catalogue=False, logs=("direction",),
        gauges=("edbb", "tracker"), inner=lambda rng, arm, joint: {"width": np.radians(rng.uniform(1.0, 30.0))},
        right=("backlash", "backlash-approach", "backlash-speed"),
    ),
    Kind(
        "wobble", "rad", MICRO, _wobble, joints="all", in_catalogue=False, right=("axis-wobble", "bearing"),
        inner=_oval,
    ),
    Kind(
        "gear-uneven", "rad", MICRO, _uneven, joints="all", in_catalogue=False, right=("gear-ripple", "harmonic"),
        inner=lambda rng, arm, joint: {"knots": float(rng.integers(12, 40)), "seed": float(rng.integers(10**6))},
    ),
    Kind(
        "hose-drag", "rad", MICRO, _dragged, joints="all", in_catalogue=False,
        inner=lambda rng, arm, joint: {
            "by": float(rng.choice([k for k in range(1, arm.n_joints) if abs(k - joint) > 1])),
            "knots": 6.0, "seed": float(rng.integers(10**6)),
        },
    ),
    Kind(
        "sawtooth", "rad", MICRO, _sawtooth, joints="all", in_catalogue=False, inner=_tone,
        right=("reducer-ripple", "gear-ripple", "harmonic"),
    ),
)  # fmt: skip
