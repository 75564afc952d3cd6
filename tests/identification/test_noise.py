"""Stated uncertainties where the noise is not what the cell says: other shares, heavy tails, correlated samples."""

import numpy as np
import pytest

from planner.fit import least_squares
from planner.inference.posterior_background import background_families
from planner.inference.posterior_fit import draw_posterior
from tests.identification.worlds import covered, trials, world
from tests.simulation.generator.truth import Noise, draw_errors

pytestmark = pytest.mark.long

HEAVY = 120  # fits
WRONG = {"joints a third of the data sheet's": Noise(3e-6, 4e-6), "gauge alone": Noise(5e-6, 1e-9)}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_share_of_the_joints_in_the_noise_does_not_make_it_over_confident(what):
    """The data sheet's repeatability is a guess: how gauge and joints share the noise comes from the run."""
    t = trials(world("comau-nj130", 120), 250, WRONG[what], seed=2)
    mean, expected = np.mean(t.square / t.P), np.mean(t.freedom / (t.freedom - 2))
    chance = np.std(t.square) / np.mean(t.square) / np.sqrt(len(t.square))
    assert mean / expected - 1 < 0.08 + 3 * chance
    assert (covered(t) / len(t.z)).mean() > 0.935


def test_heavy_tails_leave_the_fit_unbiased_and_not_over_confident():
    """And it is sharper than least squares, in which all rows count alike."""
    w = world("comau-nj130", 120)
    noise = Noise(w.model.setup.gauge.noise, w.model.setup.joint_sigma, shape="heavy")
    t = trials(w, HEAVY, noise, seed=3)
    assert np.abs(t.z.mean(axis=0)).max() < 4 * t.z.std(axis=0).max() / np.sqrt(HEAVY)
    assert (covered(t) / HEAVY).mean() > 0.93
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(least_squares, "row_weights", lambda _white, _leverage, weight: weight)
        plain = trials(w, HEAVY, noise, seed=3)
    assert np.sqrt((t.off**2).mean(axis=0) / (plain.off**2).mean(axis=0)).mean() < 0.95


def test_a_continuous_run_states_what_its_correlated_errors_leave():
    """Errors of the joints stay over 0.2 s and more of samples 10 ms apart: single samples would claim far too much."""
    w = world("comau-nj130", 4000, "continuous")
    t = trials(w, 30, Noise(1e-6, 8e-6), seed=4)
    assert (covered(t) / 30).mean() > 0.90
    assert np.mean(t.square / t.P) < 1.8  # of the blocks' scatter, not of a known noise: joint χ² is a little wide


@pytest.mark.parametrize("wander_s", [0.6, 1.5, 6.0])
def test_a_short_continuous_run_states_what_noise_that_fades_slowly_leaves(wander_s):
    """Of 445 s only 370, 150 and 40 correlation times: too few blocks, and the fit takes a part of the noise up."""
    w = world("comau-nj130", 4000, "continuous")
    t = trials(w, 20, Noise(1e-6, 8e-6, wander_s=wander_s), seed=5)
    assert 0.8 < np.sqrt((t.z**2).mean()) < 1.25
    assert (covered(t) / 20).mean() > 0.90
    assert np.mean(t.square / t.P) < 1.35


def test_noise_that_fades_slowly_is_taken_for_causes_no_more_than_noise_that_is_new_at_each_sample():
    """Families without a name that act: of arms without causes, by as many independent readings of either noise."""

    def nameless(wander_s, worth):
        """How many act in the mean of three arms, where so many samples count as one."""
        count = []
        for k in range(3):
            rng = np.random.default_rng([4, k])
            run = w.measured(draw_errors(w.arm, rng, 4e-4, 5e-4), Noise(1e-6, 8e-6, wander_s=wander_s), rng)
            drawn = draw_posterior(w.fitted(run)[0], run, w.model, families, worth, sweeps=60)
            count.append(drawn.record.count_nameless().mean())
        return np.mean(count)

    w = world("comau-nj130", 4000, "continuous")
    families = background_families(w.model.setup, w.run.samples)
    fresh, slow = nameless(1e-3, 26.0), nameless(1.5, 26.0)
    assert slow < fresh + 1.0
    assert nameless(1.5, 1.0) > 2 * slow  # were every sample to count
