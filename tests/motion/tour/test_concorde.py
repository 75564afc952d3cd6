"""Concorde's protocol against a stand-in that succeeds, crashes, hangs and lies; and the real one where it is."""

import itertools
import os
import re
import subprocess
import time

import pytest

import planner.motion.tour.solve as concorde
from planner.common.errors import MissingProgramError
from planner.motion.tour.local_search import LocalSearch
from planner.motion.tour.solve import solve_tour
from tests.motion.tour.conftest import BEHAVIOURS, driven, leg_costs, solving


def test_its_optimum_is_taken(install):
    cost = leg_costs(30, seed=8)
    exact = solve_tour(cost, method="exact")
    install(solving(exact.order))
    tour = solve_tour(cost)
    assert tour.solver == "concorde"
    assert tour.optimal
    assert tour.notes == ()
    assert tour.order.tolist() == exact.order.tolist()
    assert tour.lower_bound_s == pytest.approx(exact.lower_bound_s, abs=1e-9)


def longer_by_one_exchange(cost, order):
    """Of all tours that one exchange of two legs makes of a tour, the shortest that is longer than it."""
    turned = [
        [*order[:a], *order[a : b + 1][::-1], *order[b + 1 :]] for a in range(1, 30) for b in range(a + 1, len(order))
    ]
    return min((t for t in turned if driven(cost, t) > driven(cost, order) + 1e-3), key=lambda t: driven(cost, t))


@pytest.mark.parametrize("method", ["auto", "concorde"])
@pytest.mark.parametrize(("clusters", "forbidden"), [(0, ()), (4, ((0, 1), (2, 3)))])
def test_a_tour_that_only_seems_the_shortest_is_not_believed(install, method, clusters, forbidden):
    """It is announced as the optimum, and is a little longer than the one that the embedded solver proves."""
    cost = leg_costs(40, seed=3, clusters=clusters)
    exact = solve_tour(cost, method="exact", forbidden=forbidden)
    poor = longer_by_one_exchange(cost, exact.order.tolist())
    install(solving(poor))
    tour = solve_tour(cost, method=method, forbidden=forbidden)
    assert driven(cost, tour.order) == pytest.approx(exact.cost_s, abs=1e-4)
    assert tour.optimal
    assert tour.solver == "embedded"
    (note,) = tour.notes
    assert "announced" in note
    said = [float(number) for number in re.findall(r"(\d+\.\d+) s", note)]
    assert said == pytest.approx([driven(cost, poor), exact.cost_s], abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("worse", [True, False])
def test_a_claim_is_no_proof_where_the_own_proof_ends_early(install, monkeypatch, worse):
    """A weak first search and no search tree: a better tour is taken, its claim is not."""
    cost = leg_costs(60, seed=5, clusters=4)
    exact = solve_tour(cost, method="exact")
    order = exact.order.tolist()
    claimed = longer_by_one_exchange(cost, order) if worse else order
    monkeypatch.setattr(LocalSearch, "improve", lambda *_, **__: None)
    install(solving(claimed))
    alone, tour = solve_tour(cost, method="exact", nodes=0), solve_tour(cost, nodes=0)
    assert driven(cost, claimed) < alone.cost_s
    assert tour.cost_s == pytest.approx(driven(cost, claimed), abs=1e-9)
    assert tour.solver == "concorde"
    assert tour.optimal == (tour.cost_s - tour.lower_bound_s < 1e-4)
    assert tour.lower_bound_s <= exact.cost_s
    assert not (worse and tour.optimal)
    assert tour.optimal or any("not proven" in note for note in tour.notes)


@pytest.mark.parametrize("method", ["auto", "concorde"])
@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_failures_are_reported_and_survived(behaviour, method, install, monkeypatch):
    monkeypatch.setattr(concorde, "TIMEOUT_S", 0.5)
    install(BEHAVIOURS[behaviour])
    tour = solve_tour(leg_costs(30, seed=8), method=method)
    assert tour.solver == "embedded"
    assert tour.optimal
    assert len(tour.notes) == 1
    assert "the embedded solver took over" in tour.notes[0]
    expected = {"hang": "did not finish", "hanging child": "did not finish", "crash": "code 139"}
    assert expected.get(behaviour, "Concorde") in tour.notes[0]


def test_a_crash_that_sleeps_on_is_noticed_at_its_line(install):
    """The time-out of two minutes is left as it is: after it the note would say that it did not finish."""
    install(BEHAVIOURS["sleeping crash"])
    tour = solve_tour(leg_costs(30, seed=8))
    assert "crashed" in tour.notes[0]
    assert tour.optimal


def test_nothing_of_it_stays_behind(install, monkeypatch, tmp_path):
    monkeypatch.setattr(concorde, "TIMEOUT_S", 1.0)
    mark = tmp_path / "child"
    install(
        f"import subprocess\nopen({str(mark)!r}, 'w').write(str(subprocess.Popen(['sleep', '60']).pid))\nsignal.pause()"
    )
    solve_tour(leg_costs(20, seed=8))
    child = int(mark.read_text())
    for _ in range(2400):
        state = subprocess.run(["ps", "-o", "stat=", "-p", str(child)], capture_output=True, text=True).stdout
        if not state or state.startswith("Z"):
            break
        time.sleep(0.05)
    assert not state or state.startswith("Z")


def test_another_program_of_that_name_is_told_apart(install):
    install("", identity=False)
    tour = solve_tour(leg_costs(20, seed=8))
    assert "is not the Concorde TSP solver" in tour.notes[0]
    with pytest.raises(MissingProgramError, match="is not the Concorde TSP solver"):
        solve_tour(leg_costs(20, seed=8), method="concorde")


@pytest.mark.parametrize("n", [5, 20])
def test_demanded_but_missing(n, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("EDBB_CONCORDE", raising=False)
    with pytest.raises(MissingProgramError, match="EDBB_CONCORDE is not set") as caught:
        solve_tour(leg_costs(n, seed=8), method="concorde")
    assert caught.value.exit_code == 4
    assert solve_tour(leg_costs(n, seed=8)).notes == ()
    monkeypatch.setenv("EDBB_CONCORDE", str(tmp_path / "nowhere"))
    with pytest.raises(MissingProgramError, match="nowhere, which is not a program"):
        solve_tour(leg_costs(n, seed=8), method="concorde")


def test_no_file_is_left_where_one_stands(install, tmp_path, monkeypatch):
    cost = leg_costs(20, seed=8)
    install(solving(solve_tour(cost, method="exact").order))
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert solve_tour(cost).solver == "concorde"
    assert os.listdir(folder) == []


def _real() -> bool:
    try:
        return concorde.find_concorde() is not None
    except concorde.ConcordeError:
        return False


@pytest.mark.skipif(not _real(), reason="Concorde is not installed here (its licence is academic)")
def test_the_real_one_finds_the_same_cost():
    for n, clusters in itertools.product((30, 35, 80), (0, 4)):
        cost = leg_costs(n, seed=11, clusters=clusters)
        theirs = solve_tour(cost, method="concorde")
        ours = solve_tour(cost, method="exact")
        assert theirs.solver == "concorde"
        assert theirs.lower_bound_s == pytest.approx(ours.lower_bound_s, abs=1e-9)
