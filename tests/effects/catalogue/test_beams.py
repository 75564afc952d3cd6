"""Links as beams: where a beam's end goes under a moment, by integrating its curvature."""

import numpy as np
import pytest

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.effects.catalogue import Excitation
from planner.effects.context import Context
from planner.effects.free_laws import BeamTwist, beam_laws
from planner.runs.run import Samples

EI = 5e6  # N m²


@pytest.fixture(scope="module")
def run():
    cell = load_cell("comau-nj130/edbb", planning=False)
    q = np.random.default_rng(0).uniform(*cell.joint_range, (60, 6))
    return Excitation.of(setup_of(cell), Samples(q, np.zeros(len(q), dtype=int)))


@pytest.mark.slow
@pytest.mark.parametrize("link", [1, 2])
def test_a_beams_end_goes_where_its_curvature_leads(run, link):
    """Its pieces are turned one after the other, each by the moment there: what hangs beyond pulls on a lever."""
    station, pieces = link + 1, 2000
    c = Context(run.setup, run.samples)
    start, end = (c.stations.p[k].T for k in (station - 1, station))
    ends = [np.einsum("ijn,jn->ni", c.stations.R[k], c.moments[k]) for k in (station - 1, station)]
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    for axis in range(3):
        parts = np.stack([BeamTwist(station, axis, part)(c) for part in range(6)], axis=1)
        shift, turn, u = parts[:, :3], parts[:, 3:], c.stations.R[station, :, axis].T
        sunk = turned = np.zeros_like(end)
        for x in (np.arange(pieces) + 0.5) / pieces:
            about = np.sum(u * ((1 - x) * ends[0] + x * ends[1]), axis=1, keepdims=True)
            each = about / EI * length / pieces * u
            turned = turned + each
            sunk = sunk + np.cross(each, end - (start + x * (end - start)))
        # a turn of the whole beam per Nm of L/(E I), and where it takes the end
        np.testing.assert_allclose(
            (shift + np.cross(turn, end)) * length / EI, sunk, atol=1e-6 * np.abs(sunk).max() + 1e-15
        )
        np.testing.assert_allclose(turn * length / EI, turned, atol=1e-9 * np.abs(turned).max() + 1e-15)


def test_a_weight_at_its_end_bends_a_beam_by_the_handbook(run):
    """A cantilever with force F at its end sinks by F L³/3EI and turns by F L²/2EI: here of all that hangs beyond."""
    c = Context(run.setup, run.samples)
    station = 3  # end of link 2
    start, end = (c.stations.p[k].T for k in (station - 1, station))
    beam = end - start
    ends = [np.einsum("ijn,jn->ni", c.stations.R[k], c.moments[k]) for k in (station - 1, station)]
    force_moment = ends[0] - ends[1]  # of the force at the end about the beginning, and of the link's own weight
    across = force_moment - beam * np.sum(force_moment * beam, axis=1, keepdims=True) / np.sum(beam**2, axis=1)[:, None]
    parts = [np.stack([BeamTwist(station, a, part)(c) for part in range(6)], axis=1) for a in range(3)]
    turn = sum(p[:, 3:] for p in parts)
    np.testing.assert_allclose(turn, ends[1] + force_moment / 2, atol=1e-9 * np.abs(turn).max())
    sunk = sum(p[:, :3] + np.cross(p[:, 3:], end) for p in parts)
    handbook = np.cross(ends[1] / 2 + across / 3, beam)
    np.testing.assert_allclose(sunk, handbook, atol=1e-9 * np.abs(handbook).max())


def test_every_link_with_a_load_is_a_beam_that_bends_about_all_axes(run):
    laws = dict(beam_laws(run))
    assert {"link bending, link 1", "link bending, link 2", "link bending, link 3"} <= set(laws)
    assert "link bending, link 6" not in laws  # the tool's
    assert len(laws["link bending, link 2"]) == 3
