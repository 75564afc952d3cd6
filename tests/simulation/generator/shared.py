"""Arms and runs that several tests look at, made once."""

from collections.abc import Callable
from functools import cache

import numpy as np

from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.made import Made
from tests.simulation.generator.runs import balls, edbb_continuous, edbb_static, tracker

NAMES = tuple(BENCHES)
RUNS: dict[str, Callable[..., Made]] = {
    "edbb": edbb_static,
    "tracker": tracker,
    "balls": balls,
    "moving": edbb_continuous,
}
ACTIVE = ("payload", "force", "session")


@cache
def arm(name):
    return Arm.from_toml(name)


@cache
def run(what, name="comau-nj130", seed=3):
    size = {"moving": {"n_rows": 4000, "waypoints": 12}, "balls": {"n_poses": 80}}.get(what, {"n_poses": 120})
    logs = ACTIVE if what != "moving" else ()
    return RUNS[what](arm(name), seed=seed, logs=logs, **size)


def rng(seed=0):
    return np.random.default_rng(seed)
