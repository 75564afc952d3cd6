"""Effects of heat and time: growing links, drifting joints and base, warm-up."""

import numpy as np

from tests.simulation.generator.kinds import Kind

HOUR = 3600.0


def _links(scene, e):
    lengths = [s for s in scene.arm.slots if not s.turns and s.nominal and s.name.rstrip("0123456789") in ("a", "d")]
    return {s.name: e.size * s.nominal * scene.warmth for s in lengths}


def _warm_joint(scene, e):
    return {f"theta{e.joint}": e.size * scene.warmth}


def _drift(scene, e):
    return {f"theta{e.joint}": e.size * (scene.t - scene.t[0]) / HOUR}


def _base_drift(scene, e):
    way = (scene.t - scene.t[0]) / HOUR
    return {f"base_{x}": e.size * e["e" + x] * way for x in "xyz"}


def _saturating(scene, tau):
    return 1 - np.exp(-(scene.t - scene.t[0]) / tau)


def _warm_up(scene, e):
    return {f"theta{e.joint}": e.size * _saturating(scene, e["tau"])}


def _two_warm_ups(scene, e):
    rise = _saturating(scene, e["fast"]) - e["back"] * _saturating(scene, e["slow"])
    return {f"theta{e.joint}": e.size * rise}


def _somewhere(rng, arm, joint):
    e = rng.normal(size=3)
    return dict(zip(("ex", "ey", "ez"), e / np.linalg.norm(e), strict=True))


LOGS = ("temperature",)
KINDS = (
    Kind("thermal-links", "1/K", (2e-6, 5e-5), _links, logs=LOGS, right_anywhere=("link-growth",)),
    Kind("thermal-joint", "rad/K", (2e-6, 2e-4), _warm_joint, joints="all", logs=LOGS),
    Kind("joint-drift", "rad/h", (1e-5, 1e-3), _drift, joints="all", right=("drift", "warm-up")),
    Kind("base-drift", "m/h", (5e-6, 1e-3), _base_drift, inner=_somewhere, right=("drift",)),
    Kind(
        "warm-up", "rad", (2e-5, 1e-3), _warm_up, joints="all", right=("joint-drift", "drift"),
        inner=lambda rng, arm, joint: {"tau": rng.uniform(300.0, 2400.0)},
    ),
    Kind(
        "warm-up-two", "rad", (2e-5, 1e-3), _two_warm_ups, joints="all", in_catalogue=False,
        right=("warm-up", "joint-drift", "drift"),
        inner=lambda rng, arm, joint: {
            "fast": rng.uniform(120.0, 600.0), "slow": rng.uniform(1800.0, 5400.0), "back": rng.uniform(0.5, 1.5),
        },
    ),
)  # fmt: skip
