"""The oracle is the full non-linear fit, and the noise is what it says it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import tests.simulation.generator.oracle as oracle
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.draw import random_effect
from tests.simulation.generator.runs import edbb_static, tracker
from tests.simulation.generator.scene import total
from tests.simulation.generator.shared import arm, rng
from tests.simulation.generator.truth import Noise, draw_truth


def full_fit(m, effects=()):
    """Residual (n,) of a non-linear fit of a static bar run that starts from the nominal cell."""
    scene, names = m.scene, m.geometry[1]
    size = np.array([e.size for e in effects])

    def residual(v):
        errors = dict(zip(names, v, strict=False))
        moves = [
            {s: w * k for s, w in KINDS[e.kind].moves(scene, e.of_size(1.0)).items()}
            for e, k in zip(effects, v[len(names) :] * size, strict=True)
        ]
        bench = BENCHES[scene.arm.name]
        tool = bench.tool + [errors[f"map_{x}"] for x in "xyz"]
        fixture = bench.fixture + [errors[f"fixture_A_{x}"] for x in "xyz"]
        of_arm = {n: errors[n] for n in scene.arm.geometry}
        x = replace(scene, tool=tool).points(total(of_arm, *moves))
        out = np.linalg.norm(x - fixture, axis=1) + errors["zero"] - m.reading[:, 0]
        return np.concatenate([out / m.noise_rms, v[: len(names)] / oracle.WIDE])

    start = np.zeros(len(names) + len(effects))
    found = least_squares(residual, start, x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13)
    return found.fun[: len(scene.t)] * m.noise_rms, found.x


@pytest.mark.long
def test_oracle_is_the_full_nonlinear_fit():
    of = arm("comau-nj130")
    effects = [
        replace(random_effect(of, k, rng(2), joint=j), share=3.0)
        for k, j in (("joint-compliance", 2), ("reducer-ripple", 3))
    ]
    m = edbb_static(of, 120, seed=2, truth=draw_truth(of, 2, effects))
    knowing, found = full_fit(m, m.truth.effects)
    blind, _ = full_fit(m)
    assert oracle.rms(knowing[:, None]) == pytest.approx(m.oracle()[0], rel=0.01)
    assert oracle.rms(blind[:, None]) == pytest.approx(m.oracle(knows_effects=False)[0], rel=0.03)
    assert np.allclose(found[-2:], 1.0, atol=0.3)


def test_held_out_level_of_clean_runs_is_noise_and_leverage():
    levels = []
    for seed in range(20):
        m = tracker(arm("kuka-kr6-r700"), 100, seed=seed)
        levels.append(np.array(m.oracle()) / m.noise_rms)
    train, held = np.mean(levels, axis=0)
    p = np.linalg.matrix_rank(m.geometry[0].reshape(300, -1), tol=1e-6)
    assert train == pytest.approx(np.sqrt(1 - p / 300), rel=0.02)
    assert 1.02 < held < 1.15


def test_noise_has_the_stated_size_and_shape():
    n = {s: Noise(shape=s).draw(rng(1), 50_000, 2) for s in ("white", "heavy", "correlated")}
    for v in n.values():
        assert np.std(v) == pytest.approx(1.0, abs=0.08)
    assert np.mean(n["white"] ** 4) == pytest.approx(3.0, abs=0.2)
    assert np.mean(n["heavy"] ** 4) > 6
    assert np.corrcoef(n["correlated"][1:, 0], n["correlated"][:-1, 0])[0, 1] == pytest.approx(0.8, abs=0.02)
