"""Poses that no path joins are replaced together, and none of them comes back."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import NoSolutionError
from planner.common.progress import Stages, TimeLimit
from planner.design.candidates.pool import draw_candidates
from planner.design.observability.information import find_rule
from planner.design.off_grid import refine_poses
from planner.design.pose_selection import judge_poses, replace_all
from planner.session import planning
from planner.session.mount import join_to_mounts, with_mounts
from planner.session.options import PlanOptions
from planner.session.point_poses import BarPoses
from planner.session.tour_drive import Unreachable


@pytest.fixture(scope="module")
def chosen():
    cell = load_cell("ur10/edbb")
    pool = draw_candidates(cell, 400, seed=0)
    return cell, pool, judge_poses(cell, pool, np.arange(0, 400, 10), "O2")


@pytest.mark.slow
def test_what_was_lost_does_not_come_back(chosen):
    _, pool, choice = chosen
    bad = set(range(0, 400, 3))  # two thirds of the candidates are joined
    asked = []

    def lost(c):
        asked.append(c.chosen.copy())
        return np.array([k for k, row in enumerate(c.chosen.tolist()) if row in bad])

    done, count = replace_all(pool, choice, lost, "are lost")
    assert not bad & set(done.chosen.tolist())
    assert len(set(done.chosen.tolist())) == len(choice.chosen)
    seen = [row for rows in asked for row in set(rows.tolist()) & bad]
    assert len(seen) == len(set(seen)) == count  # no lost candidate was tried twice


def session_of(cell, pool, monkeypatch, drive):
    session = BarPoses(cell, PlanOptions())
    session.pool = pool
    place = SimpleNamespace(mounting=cell.mountings[0], cell=cell)
    monkeypatch.setattr(session, "places", lambda limit: [place])
    monkeypatch.setattr(planning, "drive_tour", drive)
    monkeypatch.setattr(session, "_find_unjoined_rows", lambda samples: np.zeros(0, dtype=int))
    return session


def test_all_lost_poses_of_a_tour_are_replaced_at_once(chosen, monkeypatch):
    cell, pool, choice = chosen
    calls = []

    def drive(place, stops, tsp, seed, first):
        calls.append([tuple(s.q) for s in stops])
        if len(calls) == 1:
            raise Unreachable((0, 3, len(stops) - 1))  # the last is one that validates
        return SimpleNamespace(visits=(), tour=SimpleNamespace(notes=()))

    session = session_of(cell, pool, monkeypatch, drive)
    _, new = session._drive_places(choice, TimeLimit(float("inf")))
    assert len(calls) == 2
    assert np.flatnonzero(new.chosen != choice.chosen).tolist() == [0, 3]
    assert len(calls[1]) == len(calls[0]) - 1
    assert calls[0][-1] not in calls[1]
    assert session.notes == ["3 poses that no path could join were replaced (fixture A)"]
    calls.clear()
    monkeypatch.setattr(planning, "certify_off_grid", lambda cell, pool, choice, limit: choice.chosen.tolist())
    _, certificate, _ = session._drive_refined_poses(choice, True, Stages())
    assert certificate == new.chosen.tolist()  # it is that of the poses that are driven


def test_a_split_cell_is_told_with_what_would_help(chosen, monkeypatch):
    cell, pool, choice = chosen

    def drive(*_):
        raise Unreachable((1,))

    with pytest.raises(NoSolutionError, match="obstacles split the cell; move the fixture"):
        session_of(cell, pool, monkeypatch, drive)._drive_places(choice, TimeLimit(float("inf")))


def test_poses_moved_to_where_no_path_joins_them_are_put_back_and_the_others_moved_anew(chosen, monkeypatch):
    cell, _, choice = chosen
    session, told = BarPoses(cell, PlanOptions()), []
    lost = iter((np.array([2, 5]), np.array([7]), np.zeros(0, dtype=int)))
    monkeypatch.setattr(session, "_find_unjoined_rows", lambda samples: next(lost))

    def move(c, stay):
        told.append(stay.tolist())
        return replace(c, q=np.where(np.isin(np.arange(40), stay)[:, None], c.q, c.q + 0.01))

    kept = session._move_joined_poses(choice, move)
    assert told == [[], [2, 5], [2, 5, 7]]
    assert np.flatnonzero((kept.q == choice.q).all(axis=1)).tolist() == [2, 5, 7]
    moved = np.setdiff1d(np.arange(40), [2, 5, 7])
    np.testing.assert_allclose(kept.q[moved], choice.q[moved] + 0.03)


@pytest.mark.slow
def test_poses_that_stay_are_where_they_were_and_the_others_better_the_index(chosen):
    cell, _, choice = chosen
    stay = np.array([2, 5, 30])
    moved = refine_poses(cell, choice, 0, stay=stay)
    np.testing.assert_array_equal(moved.q[stay], choice.q[stay])
    assert find_rule(choice.index).is_better(moved.value, choice.value)


def test_poses_that_validate_are_joined_and_none_is_lost_for_it(chosen, monkeypatch):
    cell, pool, choice = chosen
    session = BarPoses(cell, PlanOptions())
    session.pool = pool
    monkeypatch.setattr(session, "_find_unjoined_rows", lambda samples: np.zeros(0, dtype=int))
    usual = session.draw_validation(choice)
    q_lost = pool.q[usual[:3]]
    alike = lambda samples: np.flatnonzero((samples.q[:, None] == q_lost).all(axis=2).any(axis=1))  # noqa: E731
    monkeypatch.setattr(session, "_find_unjoined_rows", alike)
    joined = session.draw_validation(choice)
    assert len(set(joined.tolist())) == len(usual) == cell.plan.validate
    assert set(usual[3:].tolist()) <= set(joined.tolist())
    assert not set(usual[:3].tolist()) & set(joined.tolist())
    assert not set(choice.chosen.tolist()) & set(joined.tolist())


def test_no_doubtful_candidate_takes_the_place_of_a_lost_one(chosen):
    _, pool, choice = chosen
    doubtful = np.setdiff1d(np.arange(400), np.arange(1, 400, 20))
    rounds = iter((np.array([0, 4, 9]), np.zeros(0, dtype=int)))
    done, count = replace_all(pool, choice, lambda c: next(rounds), "are lost", lambda: doubtful)
    changed = np.flatnonzero(done.chosen != choice.chosen)
    assert count == 3
    assert changed.tolist() == [0, 4, 9]
    assert not set(done.chosen[changed].tolist()) & set(doubtful.tolist())
    with pytest.raises(NoSolutionError, match="no candidate left for its place"):
        replace_all(pool, choice, lambda c: np.array([0]), "are lost", lambda: np.arange(400))


@pytest.mark.slow
def test_candidates_are_proven_that_a_path_joins_whatever_their_neighbours_are(chosen):
    cell, pool, choice = chosen
    cell = with_mounts(cell, 0)
    session = BarPoses(cell, PlanOptions())
    session.pool, session.cell = pool, cell
    few = pool.take(np.arange(0, 400, 8))  # the states of the map: all others are judged by them alone
    session.reach = join_to_mounts(cell, few, 0)
    joined = np.zeros(400, dtype=bool)
    joined[::8] = session.reach.joined
    assert joined.sum() > 10
    doubtful = session._find_doubtful_candidates()
    np.testing.assert_array_equal(doubtful, np.flatnonzero(~joined))
    lost = session._find_unjoined_rows(choice.samples)  # these are looked at now: proven, or not
    doubtful = session._find_doubtful_candidates()
    seen = np.isin(choice.chosen, doubtful)
    np.testing.assert_array_equal(np.flatnonzero(seen), lost)
