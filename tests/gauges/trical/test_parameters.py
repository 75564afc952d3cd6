"""Which parameters the plan frees: the paper's 31 by the identifiability analysis alone, and why the others are out."""

from dataclasses import replace

import numpy as np
import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.design.pose_selection import identify_candidates

BASE = {"base_x", "base_y", "base_z", "base_rx", "base_ry", "base_rz"}
MDH = {f"{kind}{i}" for kind, rows in (("alpha", (1, 2, 3, 4, 5)), ("a", (1, 2, 3, 4, 5))) for i in rows}
MDH |= {"d3", "d4", "d5", "d6"} | {f"theta{i}" for i in (2, 3, 4, 5, 6)}
PAPER = BASE | MDH | {"beta2"} | {f"compliance{i}" for i in (2, 3, 4, 5, 6)}


def test_the_papers_set_comes_out_by_itself(cell, pool):
    """TriCal paper, section 5: base 6, MDH 19, β2, c2 … c6."""
    _, seen, rows = identify_candidates(cell, pool)
    assert (len(BASE), len(MDH), len(PAPER)) == (6, 19, 31)
    assert set(seen.names) == PAPER
    assert rows.shape == (len(pool), 3, 31)
    assert seen.gap > 1e6  # the 31 are far from what nothing shows
    why = {d.name: d.because for d in seen.dropped}
    assert set(why) == {"alpha0", "a0", "d1", "theta1", "d2", "map_x", "map_y", "map_z", "compliance1"}
    assert "no weight turns joint 1" in why["compliance1"]
    assert "axes 2 and 3 are parallel" in why["d2"]
    assert "d3" in why["d2"]
    assert all("1.9 µm" in why[f"map_{axis}"] for axis in "xyz")
    assert "base_x" in why["a0"]


def test_a_tool_that_nobody_measured_shows_its_radial_offset(cell, pool):
    """It is the tight prior that keeps the tool out, not that it could not be seen."""
    open_ = replace(cell, tool=replace(cell.tool, measured=False, prior=1e-3))
    _, seen, _ = identify_candidates(open_, pool)
    assert len(seen.names) == 32
    assert "map_x" in seen.names


def test_on_a_wall_the_first_joint_shows_its_compliance_too(cell, pool):
    tilted = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    wall = replace(cell, base=replace(cell.base, R_WB=tilted))
    _, seen, _ = identify_candidates(wall, pool)
    assert {f"compliance{i}" for i in range(1, 7)} <= set(seen.names)


def test_an_unknown_effect_is_named(cell, pool):
    wrong = replace(cell, plan=replace(cell.plan, effects=("joint complience",)))
    with pytest.raises(InputError, match=r"'joint complience'.*joint compliance"):
        identify_candidates(wrong, pool)


def test_too_few_candidates_are_told(cell, pool):
    with pytest.raises(NoSolutionError, match="only 8 candidate poses"):
        identify_candidates(cell, pool.take(np.arange(8)))
