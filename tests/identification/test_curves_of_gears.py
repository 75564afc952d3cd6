"""Whole curves of gears stand in the released robot where a dense run predicts better with them."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.identification import release
from planner.identification.cross_validation import Split
from planner.identification.posterior_background import EffectFamily, curve_groups, without_rivals_of

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
    assert release.predicts_better(other, plain, SPLIT) is better
