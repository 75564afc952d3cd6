"""Links as beams: where a beam's end goes under a moment, by integrating its curvature."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.cell.setup import setup_of
from planner.effects.basis import ONE
from planner.effects.catalogue import Excitation
from planner.effects.compliance import LoadMoment
from planner.effects.context import Context
from planner.effects.free_laws import BeamTwist, beam_laws
from planner.runs.run import Samples

EI = 5e6  # N m²


@pytest.fixture(scope="module")
def run():
    cell = load_cell("comau-nj130/edbb", planning=False)
    q = np.random.default_rng(0).uniform(*cell.joint_range, (60, 6))
    return Excitation.of(setup_of(cell), Samples(q, np.zeros(len(q), dtype=int)))


def _moved(run, station, axis, by):
    """Shift and turn of what lies beyond a station, as seen at the base, (n, 3) each."""
    c = Context(run.setup, run.samples)
    parts = np.stack([BeamTwist(station, axis, part, by)(c) for part in range(6)], axis=1)
    return parts[:, :3], parts[:, 3:], c.stations


@pytest.mark.parametrize("link", [1, 2])
def test_a_beams_end_goes_where_its_curvature_leads(run, link):
    """A beam under a moment at its end has one curvature M/EI all along: its pieces are turned one after the other."""
    station, pieces = link + 1, 2000
    c = Context(run.setup, run.samples)
    start, end = (c.stations.p[k].T for k in (station - 1, station))
    for axis in range(3):
        shift, turn, at = _moved(run, station, axis, LoadMoment(station, axis))
        u = at.R[station, :, axis].T
        moment = run.values(LoadMoment(station, axis))[:, None]
        length = np.linalg.norm(end - start, axis=1, keepdims=True)
        each = moment / EI * length / pieces
        sunk = sum(each * np.cross(u, end - (start + (k + 0.5) / pieces * (end - start))) for k in range(pieces))
        # a turn of the whole beam per Nm of L/(E I), and where it takes the end
        np.testing.assert_allclose(
            (shift + np.cross(turn, end)) * length / EI, sunk, atol=1e-9 * np.abs(sunk).max() + 1e-15
        )
        np.testing.assert_allclose(turn * length / EI, u * moment * length / EI)


def test_every_link_with_a_load_is_a_beam_that_bends_about_all_axes(run):
    laws = dict(beam_laws(run))
    assert {"link bending, link 1", "link bending, link 2", "link bending, link 3"} <= set(laws)
    assert "link bending, link 6" not in laws  # the tool's
    assert len(laws["link bending, link 2"]) == 3
    still = _moved(run, 2, 0, ONE)
    assert np.abs(still[1]).max() > 0
