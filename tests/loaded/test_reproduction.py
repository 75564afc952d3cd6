"""The paper's section 4.2 from simulation: what was built in comes back."""

import numpy as np
import pytest
from scipy.stats import chi2

import tests.loaded.reproduction as reproduction
import tests.loaded.world as world
from planner.report.loaded_report import loaded_charts

NAMES = ("readings", "deflections", "compensated", "kinematic", "known")


@pytest.fixture(scope="module")
def rows():
    return {r.what: r for r in reproduction.rows()}


@pytest.mark.slow
def test_every_number_has_its_published_one(rows):
    assert {r.published for r in rows.values()} >= {0.764, 0.933, 14.08, 180.0, 40.0}


@pytest.mark.slow
def test_the_offset_that_was_built_in_comes_back(rows):
    """As well as the cylinder's friction allows: its first harmonic, averaged over loads and senses, is some 10 um."""
    assert rows["offset a, b = 1"].ours == pytest.approx(0.764, abs=0.02)
    assert rows["phase, b = 1"].ours == pytest.approx(14.08, abs=2.0)


@pytest.mark.slow
def test_the_cylinders_friction_spreads_the_curves_as_in_the_paper(rows):
    assert rows["largest distance of the compensated curves (fig. 14a)"].ours == pytest.approx(180, rel=0.2)
    assert any("times as much as the repeats" in w for w in reproduction.evaluated().warnings)


@pytest.mark.slow
def test_the_tracker_agrees_as_well_as_in_the_paper(rows):
    assert rows["kinematic error against the tracker, mean (fig. 15)"].ours < 40


@pytest.mark.slow
def test_what_no_compliance_explains_widens_the_uncertainties():
    """The cylinder's friction is 90 times the noise of the averages: the compliances stay true within what is said."""
    found = reproduction.evaluated().compliances
    off = found.pulled - found.information @ world.SOFT
    assert float(off @ np.linalg.solve(found.information, off)) < chi2.ppf(0.999, 6)
    assert not reproduction.evaluated().problems
    assert len(found.known_combinations) == 3


@pytest.mark.slow
def test_figures(tmp_path):
    """Those of the paper and one of what the compliances are worth; drawing them all takes long."""
    paths = reproduction.write_figures(tmp_path, only=("kinematic",))
    assert [p.name for p in paths] == ["ldbb_kinematic.png"]
    assert paths[0].stat().st_size > 10_000
    assert [p.name for p in loaded_charts(reproduction.evaluated())] == list(NAMES)
