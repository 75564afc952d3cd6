"""What a length gauge sees of the NJ-130: ranks, names, sentences; against complex steps and direct perturbation."""

from dataclasses import replace

import numpy as np
import pytest

import tests.design.observability.dh_arm as dh_arm
from planner.common.errors import InputError
from planner.design.observability.identifiability import find_identifiable, format_direction
from planner.design.observability.information import index_value
from tests.design.observability.dh_arm import NJ130

CELLS = [
    ((), (), 22, 24),
    ((2,), (), 23, 25),
    ((), ("fixture", "tool"), 23, 30),
    ((2,), ("fixture", "tool"), 24, 31),
    ((), ("fixture", "tool", "zero"), 24, 31),
    ((2,), ("fixture", "tool", "zero"), 25, 32),
]


@pytest.fixture(scope="module")
def poses():
    return dh_arm.shell_poses(NJ130, 600)


def seen(poses, beta=(), free=(), arm=NJ130, **settings):
    return find_identifiable(dh_arm.rows(arm, poses, beta, free), dh_arm.names(arm, beta, free), **settings)


@pytest.mark.slow
@pytest.mark.parametrize(("beta", "free"), [((2,), ("fixture", "tool", "zero"))])
def test_rows_of_the_test_arm_agree_with_complex_steps(poses, beta, free):
    rows = dh_arm.rows(NJ130, poses[:20], beta, free)[:, 0]
    nominal = {name: value for name, _, _, value, _ in dh_arm.transforms(NJ130, beta)}
    nominal |= {"fixture_A_" + c: NJ130.fixture[k] for k, c in enumerate("xyz")} | {"zero": 0.0}
    for column, name in enumerate(dh_arm.names(NJ130, beta, free)):
        reading = dh_arm.length(NJ130, poses[:20], {name: nominal[name] + 1e-30j}, beta)
        assert np.imag(reading) / 1e-30 == pytest.approx(rows[:, column], abs=1e-12), name


@pytest.mark.parametrize(("beta", "free", "rank", "of"), CELLS)
def test_rank_of_each_cell(poses, beta, free, rank, of):
    found = seen(poses, beta, free)
    assert (found.rank, len(found.spectrum)) == (rank, of)
    assert found.gap > 1e8  # no tolerance between could give another rank
    assert len(found.dropped) == of - rank
    kept = dh_arm.rows(NJ130, poses, beta, free)[..., list(found.kept)]
    assert index_value("O2", kept) < 200


@pytest.mark.parametrize(("beta", "free", "rank", "of"), CELLS)
def test_moving_along_an_unseen_direction_leaves_the_reading(poses, beta, free, rank, of):
    nominal = {name: value for name, _, _, value, _ in dh_arm.transforms(NJ130, beta)}
    nominal |= {"fixture_A_" + c: NJ130.fixture[k] for k, c in enumerate("xyz")} | {"zero": 0.0}
    still = dh_arm.length(NJ130, poses)
    for dropped in seen(poses, beta, free).dropped:
        small = {name: nominal[name] + 1e-5 * share for name, share in dropped.direction}
        alone = {dropped.name: nominal[dropped.name] + 1e-5}
        assert np.max(np.abs(dh_arm.length(NJ130, poses, small, beta) - still)) < 1e-9, dropped
        assert np.max(np.abs(dh_arm.length(NJ130, poses, alone, beta) - still)) > 1e-7, dropped


def test_sentences_of_the_paper_cell(poses):
    d3, theta6 = seen(poses).dropped
    assert d3.because == "d3 moves with d2: axes 2 and 3 are parallel"
    assert (theta6.name, format_direction(theta6.direction)) == ("theta6", "0.95 theta6 + 0.32 alpha6")
    assert "about axis 6" in theta6.because
    assert "0.95 theta6 + 0.32 alpha6" in theta6.because


def test_the_unseen_direction_follows_the_tool_offset(poses):
    arm = replace(NJ130, tool=(0.15, 0.0, 0.05))
    theta6 = seen(poses, arm=arm).dropped[-1]
    assert dict(theta6.direction) == pytest.approx({"theta6": np.sqrt(0.1), "alpha6": np.sqrt(0.9)}) or dict(
        theta6.direction
    ) == pytest.approx({"alpha6": np.sqrt(0.9), "theta6": np.sqrt(0.1)})


def test_a_tool_point_on_the_last_axis_hides_the_last_angle(poses):
    found = seen(poses, arm=replace(NJ130, tool=(0.0, 0.0, 0.15)))
    theta6 = next(d for d in found.dropped if d.name == "theta6")
    assert theta6.direction == (("theta6", 1.0),)
    assert theta6.because == "theta6 moves no reading: it only turns about axis 6 what lies on that axis"


def test_sentences_of_the_freed_cell_speak_of_fixture_and_tool(poses):
    because = {d.name: d.because for d in seen(poses, free=("fixture", "tool", "zero")).dropped}
    assert because["fixture_A_z"].startswith("fixture_A_z moves with d1: ")
    assert "moving the fixture" in because["fixture_A_z"]
    assert "carrying the fixture round" in because["fixture_A_x"]
    assert because["map_z"].startswith("map_z moves with d6: only where the tool point sits from axis 6")


def test_preference_decides_who_stays(poses):
    names = dh_arm.names(NJ130, (), ("fixture", "tool"))
    first = [k for k, name in enumerate(names) if name.startswith(("fixture", "map"))]
    order = first + [k for k in range(len(names)) if k not in first]
    dropped = {d.name for d in seen(poses, free=("fixture", "tool"), prefer=order).dropped}
    assert not dropped & {names[k] for k in first}
    assert {"d1", "theta1", "d6", "d3"} <= dropped


def test_the_same_rank_whatever_the_units(poses):
    rows, names = dh_arm.rows(NJ130, poses, (2,), ("fixture", "tool")), dh_arm.names(NJ130, (2,), ("fixture", "tool"))
    size = np.where([n.startswith(("theta", "alpha", "beta")) for n in names], 1e-3, 1.0)  # rad against mm
    assert find_identifiable(rows * size, names, 1 / size).kept == find_identifiable(rows, names).kept


def test_a_direction_fainter_than_its_prior_is_left_out_and_weak_ones_are_named(poses):
    rows, names = dh_arm.rows(NJ130, poses), dh_arm.names(NJ130)
    prior = np.full(24, 1e-3)
    assert find_identifiable(rows, names, prior, noise=1e-4, readings=35).rank == 22  # 21 see more than their prior
    skew = replace(NJ130, alpha=(-np.pi / 2, 1e-2, np.pi / 2, -np.pi / 2, np.pi / 2, 0.0))  # d2, d3 told apart on paper
    rows = dh_arm.rows(skew, poses)
    assert find_identifiable(rows, names, prior).rank == 23
    found = find_identifiable(rows, names, prior, noise=1e-4, readings=35)
    assert found.rank == 22
    assert "hardly change" in found.dropped[0].because
    weak = find_identifiable(rows, names, prior, noise=5e-3, readings=35)
    std = (
        5e-3
        * np.sqrt(600 / 35)
        * np.sqrt(np.diag(np.linalg.inv(np.einsum("nri,nrj->ij", *[rows[..., list(weak.kept)]] * 2))))
    )
    assert [w.std for w in weak.weak] == pytest.approx(list(std[std > 1e-3]), rel=1e-6)
    assert len(weak.weak) > 0


def test_three_readings_a_pose(poses):
    """A tracker sees the point itself: only what turns about the tool point stays hidden."""
    chain = dh_arm.transforms(NJ130)[:24]
    point, axes, origins = dh_arm.forward(dh_arm.transforms(NJ130), poses)
    columns = [
        np.broadcast_to(x if kind == "T" else np.cross(x, point - o), point.shape)
        for (_, kind, *_), x, o in zip(chain, axes, origins, strict=False)
    ]
    found = find_identifiable(np.stack(columns, axis=2), dh_arm.names(NJ130))
    assert [d.name for d in found.dropped] == ["d3", "theta6"]


def test_bad_input_is_refused(poses):
    rows, names = dh_arm.rows(NJ130, poses), dh_arm.names(NJ130)
    with pytest.raises(InputError, match="24 columns, but 23 names"):
        find_identifiable(rows, names[:-1])
    with pytest.raises(InputError, match="prior sigma of d1"):
        find_identifiable(rows, names, np.where(np.arange(24) == 1, 0.0, 1.0))
    with pytest.raises(InputError, match="once"):
        find_identifiable(rows, names, prefer=[0] * 24)
    with pytest.raises(InputError, match="no reading depends"):
        find_identifiable(0 * rows, names)
