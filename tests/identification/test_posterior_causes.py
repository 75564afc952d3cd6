"""What the posterior holds and no stage has stands in the list of causes: planted causes by name, place and size."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.effects.catalogue import check_effect_name
from planner.identification.pipeline import identify
from planner.inference.candidates import Candidate, CauseComparison, TracingResult
from planner.model.finding import Finding
from planner.release.causes import name_causes
from planner.release.posterior_causes import PosteriorFamily, _PosteriorSize
from planner.runs.loader import load_run
from tests.identification.few_draws import few_draws
from tests.tracing.worlds import effect, run


def finds_nothing(*_):
    """A search that looks at causes and keeps none."""
    return [], TracingResult(tried=1)


@cache
def untraced(*effects):
    with TemporaryDirectory() as folder, few_draws():
        run_file, cell_file = run(effects, size=100).write(Path(folder))
        return identify(load_run(run_file, 6), load_cell(str(cell_file), planning=False), tracer=finds_nothing)


@pytest.mark.slow
def test_a_clean_arm_has_no_causes():
    assert untraced().findings == ()


def test_what_acts_at_many_places_stands_for_it_by_the_cause_at_its_own():
    """Drifts of all joints are one family; as a rival of a joint's warm-up the drift of that joint is named."""
    drifts = ("drift, joint 1", "drift, joint 2", "drift, base")
    family = PosteriorFamily(
        "warm-up (background)", {}, CauseComparison(Candidate("warm-up (background)", ())), {"drift": drifts}
    )
    assert family.rival_at("drift", "joint 2") == "drift, joint 2"
    assert family.rival_at("drift", "joint 5") == "drift, joint 1"
    assert family.rival_at("soft base, base", "joint 2") == "soft base, base"


PLAY = 4e-4  # [rad] between the two directions


@pytest.mark.slow
def test_play_is_named_at_its_joint_with_its_size():
    """The background has play of all joints as one family; the place where it is seen is named."""
    play = untraced(effect("backlash-approach", 3, PLAY)).findings[0]
    assert (play.name, play.grade, play.beside_stages, play.p_value) == ("backlash, joint 3", "found", True, None)
    assert abs(abs(play.value) - PLAY) < 4 * play.std
    for rival in play.rivals:
        check_effect_name(rival, 6, "a rival")
    assert play.std < 0.2 * PLAY


@pytest.mark.slow
def test_what_it_takes_away_is_what_is_left_without_it():
    """By a fit of the same robot and sizes that lacks the parameter, against the Wald statistic."""
    found = untraced(effect("backlash-approach", 3, PLAY))
    fit = found.released.posterior.fit
    (at,) = (k for k, n in enumerate(fit.model.names) if n == "backlash3")
    gram = found.released.posterior.gram
    z, covariance = fit.errors / fit.problem.prior, np.linalg.inv(fit.solution.factor.T @ fit.solution.factor)
    own = covariance[at, at]
    assert own > 0
    growth = z[at] ** 2 / own
    expected = found.release.held_out.rms * (np.sqrt(1 + growth / gram[-1, -1]) - 1)
    assert found.findings[0].gain == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_a_finding_that_the_posterior_speaks_against_leaves_the_list():
    """A cause that is not there, though a stage had it: it is said where it was looked at and rejected."""
    found = untraced(effect("backlash-approach", 3, PLAY))
    claimed = Finding(effect="backlash", on="joint 3", value=1e-5, unit="rad", probability=0.03)
    other = claimed.model_copy(update={"on": "joint 5", "rivals": ("a, b",), "rival_probabilities": (0.9,)})
    named = name_causes(TracingResult((claimed, other), tried=2), found.released, (), 100.0)
    assert "backlash, joint 5" not in [f.name for f in named.findings]
    assert [f.name for f in named.findings].count("backlash, joint 3") == 1  # as the posterior has it
    assert [(r.name, r.probability) for r in named.rejected] == [("backlash, joint 5", 0.03)]
    assert "a, b is likelier" in named.rejected[0].because


@pytest.mark.parametrize("freedom", [1, 2, 4])
@pytest.mark.parametrize("places", [2, 8])
def test_the_largest_of_many_sizes_that_are_nothing_is_as_often_so_large(freedom, places):
    """Against sizes drawn at random: a place is named by its family's probability less that it is chance."""
    drawn = np.random.default_rng(5).normal(size=(20_000, places, freedom))
    largest = np.sort(np.linalg.norm(drawn, axis=2).max(axis=1))
    for share in (0.02, 0.2):
        z = largest[int((1 - share) * len(largest))]
        size = _PosteriorSize("warm-up, joint 5", 3e-6 * z, 3e-6, "rad", freedom, 0.0)
        assert size.chance(places) == pytest.approx(share, rel=0.2)
        assert size.chance(1) == 0.0
    faint = _PosteriorSize("warm-up, joint 5", 20e-6, 18e-6, "rad", freedom, 0.0)
    assert faint.chance(8) == 1.0
