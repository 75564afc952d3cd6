"""Poses in lumps do not tell a wave from its aliases: each frequency counts for what it is worth."""

from functools import cache

import numpy as np

from planner.effects.catalogue import catalogue
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.inference.posterior_background import background_families, variant_family
from planner.inference.posterior_fit import draw_posterior
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.inner_values import other_values
from planner.tracing.state import FittedEffect
from tests.tracing.worlds import calibrated, effect

FREQUENCY, LUMPS = 13.0, 10.0  # [1/turn] of the wave, and lumps in a turn: its aliases are 10 a turn apart
WIDTH = np.radians(4.0)  # half of a lump's


@cache
def in_lumps(share=2.0):
    """Geometry alone, fitted to the poses of a run whose third joint stands in lumps; the ripple of that joint."""
    wave = effect("reducer-ripple", 3, share=share, frequency=FREQUENCY, phase=0.7)
    whole = calibrated((wave,), traced=False, size=700)
    apart = 2 * np.pi / LUMPS
    off = (whole.run.samples.q[:, 2] + apart / 2) % apart - apart / 2
    run = whole.run.take(np.flatnonzero(np.abs(off) < WIDTH))
    ripple = next(e for e in catalogue(whole.fit.setup, run.samples) if e.name == "gear ripple, joint 3")
    return run, fit(FitProblem.of(whole.fit.model, run)), ripple


def near(values, value):
    return [v for v in values if abs(v - value) < 0.5]


def test_aliases_of_a_wave_are_other_values():
    _, geometry, ripple = in_lumps()
    bare = ScoreTest.of(geometry)
    assert near(other_values(bare, FittedEffect(ripple, FREQUENCY + LUMPS)), FREQUENCY)
    others = other_values(bare, FittedEffect(ripple, FREQUENCY))
    assert not near(others, FREQUENCY)
    assert near(others, FREQUENCY - LUMPS) or near(others, FREQUENCY + LUMPS)


def test_a_wrong_alias_gives_way_to_the_wave():
    run, geometry, ripple = in_lumps()
    wrong = FittedEffect(ripple, FREQUENCY + LUMPS)
    before = fit(FitProblem.of(geometry.model.plus(list(wrong.parameters)), run))
    values = other_values(ScoreTest.of(geometry), wrong)
    families = (
        *background_families(geometry.setup, run.samples),
        *(variant_family(ripple.name, v, ripple.make(v)) for v in values),
    )
    posterior = draw_posterior(before, run, geometry.model, families, sweeps=48)
    others = posterior.record.other_values(ripple.name)
    assert sorted(others) == sorted(values)
    assert max(others, key=lambda v: others[v]) == near(values, FREQUENCY)[0]
    assert 0.5 < sum(others.values()) <= 1.0 + 1e-9
    assert posterior.record.probability(ripple.name) > 0.95  # a wave is there, whichever it is
    assert posterior.findings == (ripple.name,)
