"""Held-out errors: folds of whole groups, linearised folds against full refits, and runs with nothing but noise."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from planner.fit.cross_validation import Split, predict_held_out, predict_held_out_without, split_run
from planner.fit.least_squares import fit, solve
from planner.fit.problem import FitProblem
from planner.identification.pipeline import FitSettings, identify
from planner.inference.stages import error_reduction
from planner.runs.run import Readings, Run, Samples
from tests.identification.worlds import arm_of, declared, loaded, world
from tests.simulation.generator.runs import balls, edbb_continuous, edbb_static, tracker
from tests.simulation.generator.truth import draw_errors

FITTED = FitSettings(release=False)  # the last stage is what these tests look at


def made_run(n, rng, **how):
    samples = {k: how.pop(k) for k in ("session", "pose", "t") if k in how}
    place = how.pop("place", np.zeros(n, dtype=int))
    q = how.pop("q", rng.normal(size=(n, 6)))
    readings = Readings(position=np.zeros((n, 3))) if how.pop("tracker", False) else Readings(length=np.zeros(n))
    return Run("made", Samples(q, place, **samples), readings, tuple(str(k) for k in range(place.max() + 1)), **how)


def never_torn(s: Split):
    return all(len(np.unique(s.fold[s.group == g])) == 1 for g in np.unique(s.group))


def grouped_runs():
    rng = np.random.default_rng(0)
    q = rng.normal(size=(40, 6))[rng.integers(0, 40, 150)]
    session = np.sort(rng.integers(0, 7, 150))
    place = rng.integers(0, 5, 150)
    yield "pose", made_run(150, rng, pose=rng.integers(0, 30, 150)), "pose"
    yield "pose again, unnumbered", made_run(150, rng, q=q), "pose"
    yield "session", made_run(150, rng, session=session), "session"
    yield "few sessions", made_run(150, rng, session=np.arange(150) // 50), "block"
    yield "placement", made_run(150, rng, place=place, tracker=True), "placement"
    yield "few placements", made_run(150, rng, place=np.arange(150) // 50, tracker=True), "block"
    yield "stretch", made_run(4000, rng, t=np.arange(4000) * 1e-2, continuous=True), "stretch"


@pytest.mark.parametrize(("run", "by"), [(r, b) for _, r, b in grouped_runs()], ids=[n for n, _, _ in grouped_runs()])
def test_groups_are_never_torn_apart(run, by):
    for seed in range(5):
        s = split_run(run, 0.2, seed)
        assert s.by == by
        assert never_torn(s)
        assert s.folds == 5
        size = np.bincount([s.fold[s.group == g][0] for g in np.unique(s.group)], minlength=5)
        assert size.max() - size.min() <= 1  # groups are dealt evenly


def test_groups_are_what_they_are_called():
    runs = {name: run for name, run, _ in grouped_runs()}
    same = {
        "pose": runs["pose"].samples.pose,
        "session": runs["session"].samples.session,
        "placement": runs["placement"].samples.place,
        "pose again, unnumbered": np.unique(runs["pose again, unnumbered"].samples.q, axis=0, return_inverse=True)[1],
    }
    for name, label in same.items():
        group = split_run(runs[name]).group
        assert (
            len(np.unique(group)) == len(np.unique(label)) == len(np.unique(np.stack([group, label.ravel()]), axis=1).T)
        )


def test_of_few_sessions_every_fold_holds_some_of_each():
    """Of three, a fold would be a third of the run: neighbours are held out, and none of a pose's repeats is left."""
    rng = np.random.default_rng(1)
    session = np.arange(300) // 100
    q = rng.normal(size=(300, 6))
    q[[7, 150]] = q[[41, 260]]
    s = split_run(made_run(300, rng, session=session, q=q))
    assert (s.by, s.folds) == ("block", 5)
    assert s.groups >= 20
    for a, b in ((7, 41), (150, 260)):
        assert s.fold[a] == s.fold[b]
    for k in range(3):
        share = np.bincount(s.fold[session == k], minlength=5) / 100
        assert share.min() > 0.1
        assert share.max() < 0.35


def test_a_pose_that_is_measured_again_all_along_does_not_tie_the_run_into_one_group():
    rng = np.random.default_rng(2)
    q = rng.normal(size=(300, 6))
    q[::5] = q[0]
    s = split_run(made_run(300, rng, session=np.arange(300) // 100, q=q))
    assert s.by == "pose"
    assert never_torn(s)
    assert len(np.unique(s.fold[::5])) == 1
    assert s.folds == 5


def test_stretches_are_whole_and_everywhere():
    run = {name: run for name, run, _ in grouped_runs()}["stretch"]
    s = split_run(run)
    assert np.all(np.diff(s.group) >= 0)  # samples that follow each other stay together
    assert s.groups >= 20
    quarter = np.arange(len(run)) * 4 // len(run)
    assert all(len(np.unique(s.fold[quarter == k])) == s.folds for k in range(4))


def test_other_seeds_deal_other_folds_and_the_share_is_kept():
    run = {name: run for name, run, _ in grouped_runs()}["pose"]
    assert np.any(split_run(run, 0.2, 0).fold != split_run(run, 0.2, 1).fold)
    assert np.array_equal(split_run(run, 0.2, 3).fold, split_run(run, 0.2, 3).fold)
    assert split_run(run, 0.1).folds == 10


def refitted(found, parts):
    """Residuals of each fold by a full non-linear fit without it, noise and prior sigmas as they are."""
    problem, out = found.problem, []
    residual = np.empty((len(problem), problem.model.width))
    for f in range(parts.folds):
        train = problem.take(np.flatnonzero(parts.fold != f))
        rest = problem.take(np.flatnonzero(parts.fold == f))
        errors = solve(train, found.errors).errors
        residual[parts.fold == f] = rest.residual(errors)
        out.append(errors - found.errors)
    return residual, np.array(out)


def test_what_is_left_out_is_predicted_as_by_fits_that_never_had_it():
    w = world("comau-nj130", 120)
    rng = np.random.default_rng(7)
    run = w.measured(draw_errors(w.arm, rng), declared(w), rng)
    found, _ = w.fitted(run)
    parts = split_run(run)
    out = [k for k, name in enumerate(found.model.names) if name.startswith("alpha")]
    still = [k for k, name in enumerate(found.model.names) if name == "d4"]
    assert out
    assert still
    kept = [k for k in range(len(found.errors)) if k not in out + still]
    fixed = found.model.subset(still).fix_at(found.errors[still]).fixed
    bare = replace(found.model.subset(kept), fixed=(*found.model.fixed, *fixed))
    slow, _ = refitted(replace(found, problem=found.problem.with_model(bare), solution=Kept(found.errors[kept])), parts)
    (fast,) = predict_held_out_without(found, parts, [out], still)
    rms = np.sqrt((slow**2).mean())
    assert rms > 1.5 * np.sqrt((predict_held_out(found, parts).residual ** 2).mean())  # they mattered
    assert np.abs(fast.residual - slow).max() < 0.02 * rms


@dataclass(frozen=True)
class Kept:
    """Parameters to begin with."""

    errors: np.ndarray


@pytest.mark.parametrize("n", [60, 300])
def test_folds_by_linearisation_are_those_of_full_fits(n):
    w = world("comau-nj130", n)
    rng = np.random.default_rng(5)
    run = w.measured(draw_errors(w.arm, rng), declared(w), rng)
    found, _ = w.fitted(run)
    parts = split_run(run)
    fast = predict_held_out(found, parts)
    slow, shift = refitted(found, parts)
    rms = np.sqrt((slow**2).mean())
    assert np.abs(fast.residual - slow).max() < 0.01 * rms
    assert np.allclose(fast.shift, shift, atol=0.02 * np.abs(shift).max(axis=0))
    train = found.problem.residual(found.errors)
    assert rms > 1.02 * np.sqrt((train**2).mean())  # held out is never as good as trained
    assert fast.refitted == ()


@pytest.mark.slow
def test_a_frame_that_only_the_fold_knows_is_fitted_there_and_named():
    """Five stations of a tracker, held out whole: each one's own frame comes from its own samples."""
    arm = arm_of("ur10")
    run, cell = loaded(tracker(arm, 300, seed=3, logs=()))
    place = np.arange(len(run)) * 5 // len(run)
    run = replace(run, samples=replace(run.samples, place=place), places=("p", "q", "r", "s", "t"))
    c = identify(run, cell, settings=FITTED)
    assert c.split.by == "placement"
    parts = split_run(run)
    held = predict_held_out(c.fit, parts)
    assert {n.split("_")[1] for n in held.refitted} == {"p", "q", "r", "s", "t"}
    assert all(n.startswith("base_") for n in held.refitted)
    slow = np.empty_like(held.residual)
    names = c.fit.model.names
    frames = [j for j, n in enumerate(names) if n in held.refitted]
    for f in range(parts.folds):
        rest = c.fit.problem.take(np.flatnonzero(parts.fold == f))
        train = c.fit.problem.take(np.flatnonzero(parts.fold != f))
        errors = solve(train, c.fit.errors).errors
        fitted = zip(rest.model.parameters, errors, strict=True)
        fixed = tuple(pair for j, pair in enumerate(fitted) if j not in frames)
        here = rest.with_model(replace(rest.model.subset(frames), fixed=fixed))
        own = solve(here, c.fit.errors[frames]).errors
        slow[parts.fold == f] = here.residual(own)
    rms = np.sqrt((slow**2).mean())
    assert np.abs(held.residual - slow).max() < 0.02 * rms


NOISE_ONLY = {
    "comau-nj130 edbb": lambda s: edbb_static(arm_of("comau-nj130"), 500, seed=s, logs=()),
    "comau-nj130 continuous": lambda s: edbb_continuous(arm_of("comau-nj130"), 8000, seed=s, logs=(), waypoints=40),
    "kuka-kr6-r700 edbb": lambda s: edbb_static(arm_of("kuka-kr6-r700"), 500, seed=s, logs=()),
    "kuka-kr6-r700 tracker": lambda s: tracker(arm_of("kuka-kr6-r700"), 300, seed=s, logs=()),
    "kuka-kr6-r700 balls": lambda s: balls(arm_of("kuka-kr6-r700"), 240, seed=s, logs=()),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", NOISE_ONLY)
def test_a_run_with_noise_alone_is_explained_to_the_noise(what):
    """None of an effect is found, and held-out poses are as good as for a fit with the true arm's own rows."""
    made = NOISE_ONLY[what](7)
    run, cell = loaded(made)
    c = identify(run, cell, settings=FITTED)
    assert c.problems == ()
    assert c.stages[-1].name == "geometry"
    held = c.stages[-1].held_out.rms
    assert held == pytest.approx(made.oracle()[1], rel=0.05)
    assert held == pytest.approx(made.noise_rms, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comau-nj130", pytest.param("kuka-kr6-r700", marks=pytest.mark.long)])
def test_parameters_of_a_whole_identification_are_as_far_off_as_stated(name):
    """Through the files: joint χ² over three runs against the truth regrouped by the generator's own Jacobian."""
    square, count = 0.0, 0
    for seed in range(3):
        made = edbb_static(arm_of(name), 150, seed=100 + seed, logs=(), repeats=0.0)
        run, cell = loaded(made)
        c = identify(run, cell, settings=FITTED)
        w = replace(world(name, 80), q=made.scene.q)
        w = replace(w, model=c.fit.model, run=run)
        truth, left = w.regrouped(made.truth.errors)
        assert np.sqrt((left**2).mean()) < 1e-7
        off = c.fit.errors - truth
        square += off @ np.linalg.solve(c.covariance, off)
        count += len(off)
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], count) / count
    assert low < square / count < 1.12 * high  # the share of the joints in the noise is learnt, not known


def test_fit_is_found_again_from_a_second_start():
    w = world("comau-nj130", 120)
    rng = np.random.default_rng(9)
    run = w.measured(draw_errors(w.arm, rng), declared(w), rng)
    found, covariance = w.fitted(run)
    start = found.errors + w.model.prior * rng.normal(0.0, 0.5, len(w.names))
    again = fit(FitProblem.of(w.model, run), start=start)
    assert np.all(np.abs(again.errors - found.errors) < 0.05 * np.sqrt(np.diag(covariance)))


def test_a_part_of_a_run_may_lack_whole_groups():
    """Every third sample of groups of two: those that are left count alike, and those that are not do not count."""
    rng = np.random.default_rng(3)
    group = np.repeat(np.arange(30), 2)
    whole = Split("pose", group, group % 5, group)
    part = whole.take(np.arange(0, 60, 6))
    before = rng.normal(size=(10, 3))
    gain, error = error_reduction(before, before * np.sqrt(0.5), part)
    assert gain == pytest.approx(0.5)
    assert np.isfinite(error)
