"""Tests of a residual: as many false alarms as they say, and everything that is planted is found where it is."""

from dataclasses import replace

import numpy as np
import pytest

from planner.documents.calibration import Calibration
from planner.fit.cross_validation import number_targets
from planner.fit.problem import FitProblem, ProblemCache
from planner.identification.residual_tests import (
    MEASURING_ORDER,
    ProjectedResidual,
    ResidualBattery,
    build_battery,
    diagnose_residual,
    run_battery,
)
from tests.report.calibrated import calibrated

CASES = [("edbb_static", 90), ("tracker", 60), ("balls", 60), ("edbb_continuous", 5000)]
DRAWS = 400


@pytest.fixture(scope="module")
def c() -> Calibration:
    return calibrated("edbb_static", 160, released=False)


def drawn(rest: ProjectedResidual, white: np.ndarray) -> ProjectedResidual:
    """A residual of white numbers (m,), the model fitted to it."""
    return replace(rest, white=white - rest.basis @ (rest.basis.T @ white))


def looked_at(problem: FitProblem, c: Calibration) -> tuple[ProjectedResidual, ResidualBattery]:
    rest = ProjectedResidual.of(problem, c.fit.errors, c.run.continuous)
    tests = build_battery(problem, rest, c.run.continuous)
    assert tests is not None
    return rest, tests


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_noise_alone_is_called_chance(case: tuple[str, int]) -> None:
    left = calibrated(*case, released=False).diagnosis
    assert left.trials
    assert not left.structured
    assert left.rms == 0.0
    assert "looks random" in left.sentence


@pytest.mark.long
@pytest.mark.parametrize("tail", ["normal", "heavy"])
def test_false_alarms_are_as_rare_as_stated(c: Calibration, tail: str) -> None:
    rest, tests = looked_at(c.fit.problem, c)
    rng, alarms, each = np.random.default_rng(1), 0, []
    for _ in range(DRAWS):
        white = rng.standard_normal(len(rest.white)) if tail == "normal" else rng.standard_t(4, len(rest.white))
        left = run_battery(drawn(rest, white), tests, False, 1e-5)
        alarms += left.structured
        each += [t.p_value / len(left.trials) for t in left.trials if t.p_value < 1]
    assert alarms <= 12  # 1 in 100 is 4 of 400; more than 12 comes by chance once in 4 000 times
    if tail == "normal":  # single tests, before they are corrected: as many below 1 % as there should be
        small = sum(p < 0.01 for p in each) / (DRAWS * (tests.count + 1))
        assert 0.007 < small < 0.013


@pytest.mark.slow
def test_what_repeats_share_counts_once(c: Calibration) -> None:
    """Each pose four times with one error: told apart from chance only if the four were taken for four."""
    problem = c.fit.problem.take(np.tile(np.arange(100), 4))
    once = c.fit.problem.take(np.arange(100))
    assert len(np.unique(number_targets(problem.samples))) == len(np.unique(number_targets(once.samples)))
    rest, tests = looked_at(problem, c)
    rng, alarms = np.random.default_rng(2), 0
    for _ in range(100):
        alarms += run_battery(drawn(rest, 2 * rng.standard_normal(len(rest.white))), tests, False, 1e-5).structured
    assert alarms <= 6
    naive = replace(rest, white=np.repeat(rest.white, 4), basis=np.repeat(rest.basis, 4, axis=0) / 2)
    assert naive.dof > 3 * rest.dof


@pytest.mark.slow
def test_slow_noise_is_called_by_its_name(c: Calibration) -> None:
    """Noise that remembers the pose before: along the order of measuring, and hardly ever along anything else."""
    rest, tests = looked_at(c.fit.problem, c)
    rng, named, others = np.random.default_rng(3), 0, 0
    for _ in range(60):
        white = rng.standard_normal(len(rest.white))
        for k in range(1, len(white)):
            white[k] = 0.8 * white[k - 1] + 0.6 * white[k]
        found = {t.along for t in run_battery(drawn(rest, white), tests, False, 1e-5).found}
        named += MEASURING_ORDER in found
        others += bool(found - {MEASURING_ORDER})
    assert named >= 55
    assert others <= 9


def planted(c: Calibration, error: np.ndarray) -> set[str]:
    """Names along which structure is found when an error (n,) [m] is added to the lengths read."""
    problem = c.fit.problem
    length = problem.targets.length + error
    problem = replace(problem, targets=replace(problem.targets, length=length), memory=ProblemCache())
    rest, tests = looked_at(problem, c)
    return {t.along for t in run_battery(rest, tests, c.run.continuous, 1e-5).found}


@pytest.mark.slow
def test_more_than_the_declared_noise_is_never_called_chance(c: Calibration) -> None:
    """The same residual, held against a gauge and a robot that are said to be a quarter as noisy."""
    rms, noise = c.stages[-1].train.rms, c.fit.problem.whitener
    plain = diagnose_residual(c.fit, c.run.continuous, rms)
    assert "looks random" in plain.sentence
    finer = replace(noise, declared=noise.declared / 64, shaken=noise.shaken / 64)
    fit = replace(c.fit, problem=replace(c.fit.problem, whitener=finer, memory=ProblemCache()))
    said = diagnose_residual(fit, c.run.continuous, rms).sentence
    assert f"is {rms / finer.declared_rms:.1f} times the noise" in said
    assert "random" not in said


@pytest.mark.slow
def test_what_is_planted_is_found_where_it_is(c: Calibration) -> None:
    s, length = c.run.samples, c.run.readings.length
    assert s.t is not None
    assert s.temperature is not None
    assert s.direction is not None
    assert planted(c, np.zeros(len(length))) == set()
    hours = (s.t - s.t.mean()) / np.ptp(s.t)
    assert "time" in planted(c, 1e-4 * hours**2)
    assert "temperature" in planted(c, 1e-4 * (s.temperature - s.temperature.mean()) / np.ptp(s.temperature))
    assert "approach of joint 2" in planted(c, 1e-5 * s.direction[:, 1])
    x = (length - length.mean()) / np.ptp(length)
    assert "length" in planted(c, 3e-4 * x**3)
    z = c.fit.problem.context.bar.direction[:, 2]
    assert "direction of the bar" in planted(c, 3e-4 * z**2)
    load = c.fit.problem.context.load_torque[:, 4]
    assert "load on joint 5" in planted(c, 2e-5 * np.sign(load))


@pytest.mark.slow
def test_too_small_a_run_says_so() -> None:
    left = calibrated("edbb_static", 34, released=False).diagnosis
    assert not left.trials
    assert not left.structured
    assert "too few" in left.sentence
