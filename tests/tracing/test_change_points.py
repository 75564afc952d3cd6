"""Steps at an unknown sample and wrong rows, read by the generator's own forward model: what is said of them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from planner.effects.catalogue import Excitation
from planner.effects.steps import steppables
from planner.fit.run_setup import number_samples
from planner.identification.pipeline import FitSettings, identify
from planner.tracing.change_points import best_steps, change_sample, score_steps, step_series
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.significance import LOG_SIGNIFICANCE
from planner.tracing.state import FittedEffect, number_repeat
from planner.tracing.trace import other_series, trace
from planner.tracing.wrong_rows import find_slip
from tests.identification.worlds import declared, world
from tests.simulation.generator.truth import Noise, draw_errors

THINGS = {
    "step, gauge": ("zero",),
    "step, fixture A": ("fixture_A_x", "fixture_A_y", "fixture_A_z"),
    "step, tool point": ("map_x", "map_y", "map_z"),
    **{f"step, joint {i}": (f"theta{i}",) for i in (1, 2, 3, 4, 5)},
}


def stepped(w, seed, steps, noise=None):
    """A run in which things step: (name, samples before it, times the noise that it moves the readings by)."""
    rng, noise = np.random.default_rng([seed, 5]), noise or declared(w)
    errors = draw_errors(w.arm, rng, 4e-4, 5e-4)
    length = np.array(w.measured(errors, noise, rng).readings.length)
    shaken = (w.model.joint_rows(w.run.samples)[:, 0] * noise.joint) ** 2
    sigma = np.sqrt((noise.gauge**2 + shaken.sum(axis=1)).mean())
    for name, sample, times in steps:
        way = dict(zip(THINGS[name], rng.normal(size=len(THINGS[name])), strict=True))
        off = w.read(errors | {k: errors.get(k, 0.0) + 1e-5 * v for k, v in way.items()}) - w.read(errors)
        size = 1e-5 * times * sigma / np.sqrt((off**2).mean())
        after = errors | {k: errors.get(k, 0.0) + size * v for k, v in way.items()}
        length[sample:] += (w.read(after) - w.read(errors))[sample:]
    return w.reading(length)


@cache
def scanned(steps, n=120, seed=1):
    """Score test of the geometry's fit to a stepped run, and what may step."""
    w = world(n=n)
    found, _ = w.fitted(number_samples(stepped(w, seed, steps)))
    test = ScoreTest.of(found.count_in_full())
    return test, list(steppables(Excitation(w.model.setup, test.problem.samples)))


@pytest.mark.parametrize("name", ["step, gauge", "step, tool point", "step, joint 3"])
def test_the_score_finds_thing_and_sample(name):
    test, things = scanned(((name, 70, 4.0),))
    best = max(best_steps(test, things), key=lambda s: s.merit)
    assert best.effect.name == name
    assert abs(change_sample(FittedEffect(best.effect)) - 70) <= 2


def test_the_score_is_what_a_refit_gains():
    """The cumulative sums against the columns laid out one by one."""
    test, things = scanned((("step, joint 3", 70, 4.0),))
    for _, score in score_steps(test, things):
        other = test.score_one(score.effect)
        assert score.gain == pytest.approx(other.gain, rel=1e-6)
        assert score.size == other.size


def test_what_steps_again_and_again_is_one_thing():
    test, things = scanned((("step, gauge", 30, 60.0), ("step, gauge", 60, -90.0), ("step, gauge", 95, 30.0)))
    series = step_series(test, things)[0]
    assert {s.effect.name for s in series} == {"step, gauge"}, "joint 2 alone would explain much of it"
    assert sorted(change_sample(FittedEffect(s.effect)) for s in series)[:3] == [30, 60, 95]


def test_the_rivals_of_a_series_step_as_often():
    """What has three numbers a step is held against the zero, which has one, with all steps of both."""
    test, things = scanned((("step, gauge", 30, 60.0), ("step, gauge", 60, -90.0), ("step, gauge", 95, 30.0)))
    tool = next(thing for thing in things if str(thing.place) == "tool point")
    found = [FittedEffect(number_repeat(tool.step(k, 120), ())) for k in (30, 60, 95)]
    rivals = {c.name: c for c in other_series(things, found)}
    assert "step, tool point" not in rivals
    gauge = rivals["step, gauge"]
    assert len(gauge.parameters) == 3
    gain = {}
    for name, parameters in (("gauge", gauge.parameters), ("tool", tuple(p for f in found for p in f.effect.make()))):
        gain[name] = test.score_one(replace(found[0].effect, parameters=parameters)).gain
    assert gain["gauge"] > gain["tool"], "three numbers of the right thing explain more than nine of another"
    assert list(other_series(things, found[:1])) == []


@pytest.mark.parametrize("sample", [3, 60, 117])
def test_a_step_has_three_samples_on_either_side(sample):
    """The first and the last place that a step may take, and one in between."""
    test, things = scanned((("step, gauge", sample, 60.0),))
    best = min(best_steps(test, things), key=lambda s: s.log_p)
    assert best.log_p < LOG_SIGNIFICANCE
    assert change_sample(FittedEffect(best.effect)) == sample


@pytest.mark.parametrize("sample", [1, 2, 118, 119])
def test_one_or_two_samples_at_an_end_are_no_step_of_theirs(sample):
    """Of so few nobody knows which errs: no step is placed there, however far off they are."""
    test, things = scanned((("step, gauge", sample, 60.0),))
    for _, score in score_steps(test, things):
        assert 3 <= change_sample(FittedEffect(score.effect)) <= 117


@pytest.mark.parametrize("row", [1, 4, 115, 118])
def test_a_lone_outlier_is_no_step(row):
    """One reading far off looks like a step of whatever moved it: without it there is none."""
    w = world(n=120)
    length = np.array(stepped(w, 1, ()).readings.length)
    length[row] += 4e-4  # twenty times the noise
    found, _ = w.fitted(number_samples(w.reading(length)))
    test = ScoreTest.of(found.count_in_full())
    things = list(steppables(Excitation(w.model.setup, test.problem.samples)))
    assert min(s.log_p for _, s in score_steps(test, things)) < LOG_SIGNIFICANCE
    assert min(s.log_p for s in best_steps(test, things)) > LOG_SIGNIFICANCE


@pytest.mark.slow
def test_a_step_and_a_mistyped_row_are_named():
    w = world(n=120)
    run = stepped(w, 1, (("step, fixture A", 80, 5.0),))
    length = np.array(run.readings.length)
    k = next(k for k in range(40, 80) if (text := f"{1e3 * length[k]:.3f}")[1] != text[2])
    text = f"{1e3 * length[k]:.3f}"
    length[k] = float(text[0] + text[2] + text[1] + text[3:]) * 1e-3
    found = identify(w.reading(length), w.cell, settings=FitSettings(release=False), tracer=trace)
    row, step = found.findings
    assert (row.effect, row.row) == ("wrong row", k + 1)
    assert f"'{text[2]}{text[1]}' for '{text[1]}{text[2]}'" in row.note
    assert (step.effect, step.on) == ("step", "fixture A")
    assert abs(step.after_sample - 80) <= 2
    assert step.surely_within[0] <= 80 <= step.surely_within[1]
    assert f"after sample {step.after_sample} (run.csv, line {step.after_sample + 2})" in step.note
    assert not any(g.startswith(("step", "wrong row")) for g in [e.name for e in found.fit.model.setup.robot.effects])


@pytest.mark.parametrize(
    ("read", "wanted", "words"),
    [
        (305.164, 350.16, "'05' for '50'"),
        (-12.5, 12.5, "its sign was lost"),
        (3051.64, 305.16, "its point stands one place off"),
        (805.164, 305.16, "'8' for '3'"),
        (305.164, 311.0, ""),
    ],
)
def test_slips_of_the_pen_are_recognised(read, wanted, words):
    assert find_slip(read, wanted, 0.02) == words


@pytest.mark.long
def test_steps_at_three_times_the_noise_are_found():
    """Single steps of three times the noise are found, at their sample and by their name, but for one of all things."""
    w, named, timed, right = world(n=200), 0, 0, 0
    for seed, name in enumerate(THINGS):
        sample = int(np.random.default_rng([seed, 9]).integers(20, 180))
        run = stepped(w, seed, ((name, sample, 3.0),))
        found = identify(run, w.cell, tracer=trace, settings=FitSettings(release=False))
        steps = [f for f in found.findings if f.effect == "step"]
        named += bool(steps)
        timed += any(abs(f.after_sample - sample) <= 4 for f in steps)
        right += any(name in (f.name, *f.rivals) for f in steps)
    assert min(named, timed, right) >= len(THINGS) - 1


@pytest.mark.long
def test_clean_runs_name_no_step():
    """The surest step of clean runs, scored only."""
    w, sure = world(n=120), 0
    for seed in range(100):
        rng = np.random.default_rng([seed, 3])
        found, _ = w.fitted(number_samples(w.measured(draw_errors(w.arm, rng, 4e-4, 5e-4), Noise(), rng)))
        test = ScoreTest.of(found)
        things = list(steppables(Excitation(w.model.setup, test.problem.samples)))
        sure += min(s.log_p for s in best_steps(test, things)) < np.log(2e-3)
    assert sure <= 2
