"""Reversals against a plain loop."""

import numpy as np

from planner.runs.joint_motion import last_reversals
from tests.effects.catalogue.columns import reversals as plain


def test_reversals_agree_with_a_plain_loop():
    t = np.linspace(0, 20, 4000)
    q = np.stack([np.sin(t), np.sin(1.7 * t) + 0.3 * np.sin(5 * t), 0.2 * t], axis=1)
    alike = np.abs(last_reversals(q, 3) - plain(q, 3)) < 1e-4
    assert alike.mean() > 0.97  # a reversal shows only after a step of travel, a few samples later
    assert alike[-1].all()


def test_noise_of_the_encoder_is_no_reversal():
    t = np.linspace(0, 10, 5000)
    q = np.sin(t)[:, None] + np.random.default_rng(0).uniform(-1e-6, 1e-6, (5000, 1))
    late = last_reversals(q, 2)[-1, 0]
    np.testing.assert_allclose(np.abs(late), 1.0, atol=1e-3)
