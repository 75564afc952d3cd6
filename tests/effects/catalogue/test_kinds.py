"""Each kind of effect of the generator, planted alone and large, is explained whole by the entry that names it."""

from dataclasses import replace

import numpy as np
import pytest

from planner.effects.catalogue import catalogue
from planner.fit.identifiable_parameters import identifiable_subset
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, setup_for_run
from planner.model.model import Model
from tests.effects.catalogue.columns import seen
from tests.effects.catalogue.naming import inner, joint_of, named
from tests.identification.worlds import arm_of, loaded
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.draw import random_effect
from tests.simulation.generator.oracle import rms
from tests.simulation.generator.runs import balls, edbb_continuous, edbb_static, tracker
from tests.simulation.generator.sizing import Implausible
from tests.simulation.generator.truth import draw_truth

SHARE = 8.0  # times the noise
RUNS = (
    ("tracker", False, tracker, {"n_poses": 150}),
    ("edbb", False, edbb_static, {"n_poses": 200}),
    ("edbb", True, edbb_continuous, {"n_rows": 2500, "waypoints": 30}),
    ("balls", False, balls, {"n_poses": 100}),
)
# share of the noise that an entry may leave more than the oracle: the form is not the generator's own
LOOSE = {"gauge-lag": 0.06, "gauge-filter": 0.15, "gauge-interpolation": 0.12, "hysteresis": 0.5, "gauge-sag": 0.05}
# a body that warms up twice, and a tooth of a saw, are more than one wave or one time constant
COMPOUND = ("warm-up-two", "sawtooth")


def planted(kind, name="comau-nj130"):
    """A run with one effect of a kind, on the first gauge that can show it at a plausible size."""
    arm = arm_of(name)
    for gauge, moving, build, how in RUNS:
        if not KINDS[kind].allows(gauge, moving):
            continue
        tried = set()
        for seed in range(8):
            effect = random_effect(arm, kind, np.random.default_rng([5, seed]), share=SHARE)
            if (effect.joint, effect.inner) in tried:  # its size follows from the share
                continue
            tried.add((effect.joint, effect.inner))
            try:
                return build(arm, seed=5, truth=draw_truth(arm, 5, [effect]), logs=(), **how)
            except Implausible:
                continue
    return None


def measured(made):
    """Run, setup and the model of the geometry that the run shows."""
    run, cell = loaded(made)
    setup = locate_gauge(setup_for_run(cell, run), run)
    run = replace(run, samples=seen(run.samples, run.readings, run.continuous))
    return run, setup, identifiable_subset(Model.of(setup, cell.plan.free), run.samples)[0]


def left(model, run):
    """RMS [m] that a fit leaves, and its parameters."""
    found = fit(FitProblem.of(model, run))
    return rms(found.problem.residual(found.errors)), dict(zip(found.model.names, found.errors, strict=True))


# a curve that is no wave, and a cause that no entry has: the search makes its own entries for them
NO_ENTRY = ("gear-uneven", "hose-drag")
SHOWN = [k for k, row in KINDS.items() if not row.absorbed and k not in (*COMPOUND, *NO_ENTRY)]


@pytest.mark.parametrize("kind", SHOWN)
def test_planted_effect_is_explained_by_its_entry(kind):
    made = planted(kind)
    if made is None:
        assert kind == "tool-compliance"  # no plausible tool bends that much
        return
    effect = made.truth.effects[0]
    run, setup, model = measured(made)
    entries = {(e.kind, str(e.place)): e for e in catalogue(setup, run.samples)}
    entry = entries[named(effect)]
    more = identifiable_subset(model.plus(list(entry.make(inner(effect)))), run.samples)[0]
    oracle = made.oracle()[0]
    after, values = left(more, run)
    assert left(model, run)[0] > 4 * oracle
    assert after < (1.02 + LOOSE.get(kind, 0.0)) * oracle
    own = [abs(values[p.name]) for p in entry.make(inner(effect)) if p.name in values]
    assert 0 < max(own) < entry.largest
    assert KINDS[kind].counts_as_right(effect, entry.kind, joint_of(str(entry.place)))


@pytest.mark.parametrize("kind", COMPOUND)
def test_compound_effect_has_a_name_in_the_catalogue(kind):
    made = planted(kind)
    run, setup, _ = measured(made)
    entries = {(e.kind, str(e.place)): e for e in catalogue(setup, run.samples)}
    entry = entries[named(made.truth.effects[0])]
    assert KINDS[kind].counts_as_right(made.truth.effects[0], entry.kind, joint_of(str(entry.place)))


@pytest.mark.slow
def test_no_entry_of_the_catalogue_explains_what_has_no_entry():
    for kind in NO_ENTRY:
        run, setup, model = measured(planted(kind))
        alike = next(e for e in catalogue(setup, run.samples) if e.kind == "encoder once a turn")
        more = identifiable_subset(model.plus(list(alike.make(None))), run.samples)[0]
        assert left(more, run)[0] > 0.5 * left(model, run)[0]


def test_absorbed_effects_are_in_the_catalogue_too():
    made = edbb_static(arm_of("comau-nj130"), 40, seed=5, logs=())
    run, setup, _ = measured(made)
    there = {(e.kind, str(e.place)) for e in catalogue(setup, run.samples)}
    assert {
        ("gauge scale", "gauge"),
        ("ball centre", "ball at the fixture"),
        ("ball centre", "ball on the tool"),
    } <= there
