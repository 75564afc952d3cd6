"""Whole curves of gears stand in the released robot where a dense run predicts better with them."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.effects.nonparametric import gear_curve
from planner.fit.cross_validation import Split, split_run
from planner.fit.identifiable_parameters import parameters_of_groups
from planner.inference import misfit
from planner.inference.posterior_background import EffectFamily, curve_groups, without_rivals_of
from planner.inference.posterior_fit import draw_posterior
from planner.inference.stages import FitContext
from planner.release import releasing
from planner.tracing.state import FittedEffect
from tests.tracing.worlds import calibrated, effect

GROUP = np.repeat(np.arange(40), 5)
SPLIT = Split("block", GROUP, GROUP % 5, GROUP)


def test_a_curve_stands_for_the_harmonics_and_ripple_of_its_own_gear_alone():
    kinds = ("once a turn", "twice a turn", "harmonics", "ripple")
    gears = [f"gear {kind}, joint {joint}" for joint in (1, 2, 12) for kind in kinds]
    families = [EffectFamily(name, ()) for name in (*gears, "joint 2 by joint 1", "joint compliance, joint 2")]
    model = SimpleNamespace(
        parameters=[SimpleNamespace(group=g) for g in ("geometry", "gear error curve, joint 2", "backlash, joint 1")]
    )
    curves = curve_groups(model)
    assert curves == {"gear error curve, joint 2"}
    left = [f.name for f in without_rivals_of(curves, families)]
    assert left == [f.name for f in families if not (f.name.startswith("gear ") and f.name.endswith(", joint 2"))]
    assert without_rivals_of((), families) == tuple(families)


@pytest.mark.parametrize(
    ("mine", "noise", "better"),
    [(0.7, 0.0, True), (0.98, 0.0, False), (1.3, 0.0, False), (0.85, 40.0, False)],
    ids=["clearly", "hardly", "worse", "by chance"],
)
def test_samples_that_were_not_seen_decide_beyond_chance(mine, noise, better):
    rng = np.random.default_rng(5)
    plain = rng.normal(0.0, [1e-4, 3e-3], (len(GROUP), 2))
    other = plain * mine
    other[GROUP == 3] *= 1 + noise
    plain = plain.copy()
    plain[GROUP == 4] *= 1 + 1.2 * noise
    assert releasing.predicts_better(other, plain, SPLIT) is better


class RegionsPredictedError(Exception):
    """Ends a release once the regions are predicted."""


@pytest.mark.slow
@pytest.mark.parametrize("taken", [True, pytest.param(False, marks=pytest.mark.long)], ids=["curves", "harmonics"])
def test_regions_held_out_are_predicted_by_the_families_of_the_posterior(taken, monkeypatch):
    """What they say of it would else be said of a robot that nobody is given."""
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    bench = FitContext(found.run, split_run(found.run), lambda _: None)
    geometry = bench.fit_stage("geometry", parameters_of_groups(found.fit.model, ("gauge", "geometry")))
    curve = FittedEffect(gear_curve(found.fit.setup, found.run.samples.q, 2, 10.0))
    last = bench.fit_stage(curve.name, geometry.fit.model.plus(list(curve.parameters)), geometry.fit)
    names = []

    def draw(*args, **how):
        """Draw as usual, only shortly."""
        drawn = draw_posterior(*args, **(how | {"sweeps": 6}))
        names.append(frozenset(drawn.record.names))
        return drawn

    def predict(*args):
        """Predict the regions, and go no further."""
        misfit.predict_regions(*args)
        raise RegionsPredictedError

    for room in (releasing, misfit):
        monkeypatch.setattr(room, "draw_posterior", draw)
    monkeypatch.setattr(releasing, "predict_regions", predict)
    monkeypatch.setattr(releasing, "DENSE_READINGS", 0)
    monkeypatch.setattr(releasing, "predicts_better", lambda *_: taken)
    with pytest.raises(RegionsPredictedError):
        releasing.release_robot((geometry, last), geometry.fit.model, bench, None, 1.0, False, None)
    *tried, posterior = names[:3]
    assert posterior == tried[taken] != tried[not taken]
    assert any(curve.name in n for n in posterior) is taken
    assert len(names) == 3 + 4
    assert set(names[3:]) == {posterior}
