"""Draws are the same with the linear algebra of another processor: each kernel in a process of its own."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from planner.inference.posterior_draws import RandomEffects, SizeDraw, SizePrior, draw_sizes
from planner.inference.size_mixture import SizeMixture

SLAB = SizePrior(np.array([0.0, 0.3, 1.0, 3.0]), np.array([0.7, 0.1, 0.1, 0.1]), pool=1)


def drawn():
    """Sizes, noise and the limit of 95 % of drawn robots, of a run of 90 readings and 40 families of four columns."""
    rng = np.random.default_rng(8)
    family = np.append(np.repeat(np.arange(40), 4), [-1] * 5)
    columns = rng.normal(size=(90, len(family))) * np.where(family < 0, 1e5, 0.5)
    columns[:, 4:8] = columns[:, :4] @ rng.normal(size=(4, 4)) + 1e-3 * rng.normal(size=(90, 4))  # as good as the first
    y = rng.normal(size=90) + columns @ np.where(np.isin(family, (0, 7, 21)), 1.0, 0.0)
    noise = np.stack([np.ones(90), rng.uniform(0, 2, 90)], axis=1)
    model = RandomEffects(columns, y, family, noise, (SLAB,) * 40, np.eye(2), np.arange(90), np.ones(90))
    draws = draw_sizes(model, SizeDraw(np.zeros(40), np.zeros(2)), sweeps=60)
    size = np.stack([model.sizes(d.factors) for d in draws])
    white = np.column_stack([columns, y])
    robots = SizeMixture(size, np.ones(len(draws))).moments(white.T @ white, np.zeros(len(family))).drawn
    limit = np.quantile(np.sqrt((robots[family >= 0] ** 2).sum(axis=0)), 0.95)
    return {"factors": [d.factors.tolist() for d in draws], "noise": draws[-1].noise_logs.tolist(), "limit": limit}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="OpenBLAS chooses its kernel by this name on x86")
def test_another_kernel_draws_the_same():
    found = []
    for kernel in (None, "Prescott", "Haswell"):
        own = {k: v for k, v in os.environ.items() if k != "OPENBLAS_CORETYPE"}
        own |= {} if kernel is None else {"OPENBLAS_CORETYPE": kernel}
        code = "import json; from tests.identification.test_kernels import drawn; print(json.dumps(drawn()))"
        done = subprocess.run([sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True)
        found.append(json.loads(done.stdout))
    for other in found[1:]:
        assert other["factors"] == found[0]["factors"]
        assert other["noise"] == pytest.approx(found[0]["noise"], rel=1e-6)
        assert other["limit"] == pytest.approx(found[0]["limit"], rel=1e-6)
