"""A gauge left standing between two runs: what the second need not find anew, and what is said when it was moved."""

import json
import tomllib
from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.content_hashes import part_hashes
from planner.common.errors import InputError
from planner.design.expected_errors import error_limit
from planner.kinematics.robot_hash import model_text_hash
from planner.model.finding import Finding
from planner.next_session.live_estimate import LiveEstimate, PoseReading, mean_errors
from planner.next_session.planned_poses import foresee_more_poses, minutes_a_pose
from planner.next_session.remaining_errors import CalibratedState, RemainingErrors, leave_standing
from planner.runs.run import FIRST_MOUNTING, Samples
from planner.session.movable_cell import cell_files
from planner.session.options import PlanOptions
from planner.tracing.trace import locate_session_step
from planner.workflow import identification
from planner.workflow.identification import identify
from planner.workflow.measured_runs import load_sessions, run_sources
from tests.identification.few_draws import few_draws
from tests.identification.joint_world import BAR_LEFT, BAR_RIGHT, WIRE, World


def named(session, name):
    """The session whose cell says how its set-up is called."""
    session.cell.write_text(session.cell.read_text().replace('zero = "free"', f'zero = "free"\nmounting = "{name}"'))
    return session


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """An arm measured once, what that run says of it, and a second run with the gauge as it was left."""
    folder, world = tmp_path_factory.mktemp("mounting"), World.drawn(11)
    first = named(world.measure(folder / "first", BAR_LEFT, 11), "monday")
    second = world.measure(folder / "second", BAR_LEFT, 12)
    cell = load_cell(str(first.cell), planning=False)
    with few_draws():
        found = identify(first.run, cell=first.cell, no_trace=True)
    (folder / "known").mkdir()
    (folder / "known" / "identification.json").write_text(found.to_json())
    found.write_robot(folder / "known")
    return Of(folder=folder, world=world, first=first, second=second, cell=cell, found=found)


@pytest.mark.slow
def test_what_the_first_run_says_of_the_second_is_its_whole_posterior(known):
    """Readings at other poses, by the file and by the fit's own covariance of everything that moves them."""
    before = CalibratedState.read(known.folder / "known", known.cell)
    samples = Samples(known.second.q, np.zeros(len(known.second.q), dtype=int))
    unknown = RemainingErrors.of(before, known.cell, samples)
    fit = known.found.calibration.released.posterior.fit
    rows = fit.model.rows(samples)[:, 0] @ fit.solution.root(fit.problem.prior)
    stretch = np.sqrt((known.found.calibration.released.misfit.stretch**2).mean())
    theirs = stretch * np.linalg.norm(rows, axis=1)
    moved = unknown.model.rows(samples)[:, 0] @ unknown.root
    both = np.linalg.norm(moved[:, ~unknown.of_gauge], axis=1)
    # less than a reading's noise: the gauge's own errors stand apart
    assert np.all(np.abs(both - theirs) < unknown.model.noise(samples))
    own = np.linalg.norm(moved, axis=1)  # with the gauge's scale, of which the file does not know how it hangs together
    assert own.max() < 25e-6  # a gauge set up anew: 3 mm
    live = LiveEstimate(unknown, samples)
    live.add_all({k: PoseReading.of_length(length) for k, length in enumerate(known.second.length)})
    off = np.array(live.off) / np.hypot(own / unknown.model.noise(samples), 1.0)
    assert np.sqrt((off**2).mean()) < 2.0  # the second run reads what the first foretells


@pytest.mark.slow
def test_further_readings_scatter_as_those_of_the_runs_so_far(known):
    """By how far a reading moves with each joint, taken by differences."""
    before = CalibratedState.read(known.folder / "known", known.cell)
    assert before.rest == json.loads((known.folder / "known" / "posterior.json").read_text())["noise"][1] != 1.0
    q, step = known.second.q[:20], 1e-6
    samples = Samples(q, np.zeros(len(q), dtype=int))
    unknown = RemainingErrors.of(replace(before, rest=0.4), known.cell, samples)
    model, errors = unknown.model, mean_errors(unknown)
    ends = [
        [model.reading(replace(samples, q=q + sign * step * axis), errors)[:, 0] for sign in (1, -1)]
        for axis in np.eye(q.shape[1])
    ]
    by_joint = np.array([(up - down) / (2 * step) for up, down in ends])
    scatter = np.sqrt(model.setup.gauge.sigmas[0] ** 2 + ((0.4 * model.joint_sigma * by_joint) ** 2).sum(axis=0))
    moved = model.rows(samples)[:, 0] @ unknown.root
    assert unknown.white(samples) * scatter[:, None] == pytest.approx(moved, rel=5e-3, abs=1e-9)


@pytest.mark.slow
def test_a_gauge_left_standing_leaves_less_open_than_one_set_up_anew(known):
    before = CalibratedState.read(known.folder / "known", known.cell)
    samples = Samples(known.second.q, np.zeros(len(known.second.q), dtype=int))
    anew_cell = replace(known.cell, gauge=replace(known.cell.gauge, mounting=""))
    standing, anew = (RemainingErrors.of(before, c, samples) for c in (known.cell, anew_cell))
    assert standing.stands is not None
    assert anew.stands is None
    few = np.arange(4)  # so many only tell where a new gauge stands
    limits = [error_limit(u, u.white(samples)[few]) for u in (standing, anew)]
    assert limits[0] < limits[1] <= anew.limit_before * 1.0001
    assert mean_errors(standing)[standing.model.names.index("fixture_A_x")]
    assert not mean_errors(anew)[anew.model.names.index("fixture_A_x")]


@pytest.mark.slow
def test_the_plan_carries_the_mounting_on(known):
    cell = replace(known.cell, gauge=replace(known.cell.gauge, mounting=""))
    before = CalibratedState.read(known.folder / "known", cell)
    assert cell.gauge.preparation(cell, FIRST_MOUNTING)[1].endswith("set its zero")
    left = leave_standing(cell, before)
    assert left.gauge.preparation(left, FIRST_MOUNTING)[1].endswith("leave fixture and zero as they stand")
    assert tomllib.loads(cell_files(left)["cell.toml"].decode())["gauge"]["mounting"] == "monday"
    steps = type(left.gauge).session_guide(left.file)
    assert "Leave every fixture as it stands" in str(steps)
    assert "Set it to zero" not in str(steps)
    moved = replace(cell, fixtures=(replace(cell.fixtures[0], p_BX=cell.fixtures[0].p_BX + 1e-3),))
    with pytest.raises(InputError, match="fixture 'A' stands elsewhere"):
        leave_standing(moved, before)
    content = json.loads((known.folder / "known" / "expected_error.json").read_text())
    content.pop("gauge")
    silent = replace(before, known=replace(before.known, file=type(before.known.file).model_validate(content)))
    with pytest.raises(InputError, match="does not say where a gauge stands"):
        leave_standing(cell, silent)
    with pytest.raises(InputError, match="--same-mounting goes with --after"):
        PlanOptions(same_mounting=True).aims_at_tracing(cell)


@pytest.mark.slow
def test_runs_of_one_mounting_share_place_and_zero(tmp_path):
    world = World.drawn(2)
    one, two = (named(world.measure(tmp_path / d, BAR_LEFT, k), "monday") for k, d in enumerate(("one", "two")))
    other = world.measure(tmp_path / "other", BAR_LEFT, 9)
    run, cell, _ = load_sessions(run_sources([one.run, two.run], None, None))
    assert (run.places, cell.gauge.mounting, cell.gauge.kind) == (("A",), "monday", "edbb")
    assert run.samples.session_numbers.tolist() == [0] * len(one.q) + [1] * len(two.q)
    assert len(run.readings.length) == len(one.q) + len(two.q)
    run, cell, _ = load_sessions(run_sources([one.run, other.run, two.run], None, None))
    assert run.places == ("one+two/A", "other/A")
    alone, _, _ = load_sessions(run_sources([two.run, other.run], None, None))
    assert "gauge.mounting = 'monday'" in alone.warnings[-1]
    named(other, "monday").cell.write_text(other.cell.read_text().replace("430.0", "431.0"))
    with pytest.raises(InputError, match="was left standing, but gauge, fixtures or tool points are not those"):
        load_sessions(run_sources([one.run, other.run], None, None))


@pytest.mark.slow
@pytest.mark.parametrize("moved", [(0.4e-3, 0.2e-3, 0.0), (0.0, 0.0, 0.0)])
def test_a_gauge_that_was_moved_after_all_is_told(tmp_path, moved):
    world = World.drawn(1)
    off = BAR_LEFT.__class__(**{**vars(BAR_LEFT), "off": tuple(np.add(BAR_LEFT.off, moved))})
    one, two = (named(world.measure(tmp_path / d, b, k), "monday") for d, b, k in (("a", BAR_LEFT, 1), ("b", off, 2)))
    found = identify([one.run, two.run], release=False)
    told = [f.note for f in found.findings]
    assert len(told) == bool(any(moved))
    if told:
        assert told[0].startswith("the gauge (or the base) was moved between a/run.csv and b/run.csv")
        assert found.findings[0].value == pytest.approx(np.linalg.norm(moved), abs=6 * found.findings[0].std)


@pytest.mark.slow
def test_several_set_ups_leave_the_last_one_standing(tmp_path):
    """The zero and the fixture of the last session, by the names that its own cell has for them."""
    world = World.drawn(4)
    one, two = (world.measure(tmp_path / d, b, k) for k, (d, b) in enumerate((("one", BAR_RIGHT), ("two", BAR_LEFT))))
    named(two, "tuesday")
    with few_draws():
        found = identify([one.run, two.run], no_trace=True)
    (tmp_path / "both").mkdir()
    found.write_robot(tmp_path / "both")
    gauge = json.loads((tmp_path / "both" / "expected_error.json").read_text())["gauge"]
    assert gauge["mounting"] == "tuesday"
    assert gauge["parameters"] == [*(f"fixture_A_{a}" for a in "xyz"), "zero"]
    values = found.calibration.released.posterior.fit.values
    assert gauge["values"] == pytest.approx(
        [values[n] for n in (*(f"fixture_A_{a}" for a in "xyz"), "zero_2")], rel=1e-4
    )
    assert list(gauge["fixtures_mm"]) == ["A"]


@pytest.mark.slow
def test_an_identification_foresees_what_more_poses_would_bring(known):
    """Twenty poses more, by the poses that were measured; a run without a clock says no minutes."""
    found, more = known.found.calibration, known.found.calibration.more
    assert (more.poses, more.minutes) == (20, None)
    assert 0.0 < more.anywhere < more.at_most <= found.released.at_most
    assert more.anywhere < found.workspace_error
    told = known.found.content()["more"]
    assert told["at_most_mm"] == pytest.approx(1e3 * more.at_most, rel=1e-3)
    assert more.sentence in str(known.found.overview())
    timed = replace(found.run.samples, t=21.0 * np.arange(len(found.run)))
    slow = found.model_copy(update={"run": replace(found.run, samples=timed)})
    later = foresee_more_poses(slow, known.cell, known.found.errors_content)
    assert later.minutes == pytest.approx(7.0)
    assert "20 more poses, about 7 min, would bring it to" in later.sentence


@pytest.mark.slow
def test_what_the_file_says_is_made_once(tmp_path, known, monkeypatch):
    """What foresees more poses and what is written beside the robot are one content."""
    monkeypatch.setattr(identification, "expected_error_content", None)  # not asked again
    known.found.write_robot(tmp_path)
    written = json.loads((tmp_path / "expected_error.json").read_text())
    assert written["robot_sha256"] == model_text_hash((tmp_path / "robot.toml").read_text())
    assert written["gauge"]["mounting"] == "monday"
    left_open = {"robot_sha256": "", "gauge": {**written["gauge"], "mounting": ""}}
    assert written.pop("hashes") == part_hashes(written)  # of what was written: nothing is left out
    assert {**written, **left_open} == json.loads(json.dumps(known.found.errors_content))


@pytest.mark.slow
def test_the_next_gauge_may_be_another_one_or_stand_at_a_second_fixture(known, tmp_path):
    """Only the gauge that was left standing counts as known; what another shows of the robot counts all the same."""
    wire = known.world.measure(tmp_path / "wire", WIRE, 21)
    cell = load_cell(str(wire.cell), planning=False)
    before = CalibratedState.read(known.folder / "known", cell)
    other = RemainingErrors.of(before, cell, Samples(wire.q, np.zeros(len(wire.q), dtype=int)))
    assert other.stands is None
    assert other.limit_before == pytest.approx(before.at_most, rel=0.02)
    assert error_limit(other, other.white(Samples(wire.q, np.zeros(len(wire.q), dtype=int)))) < before.at_most
    right = known.world.measure(tmp_path / "right", BAR_RIGHT, 22)
    second = load_cell(str(right.cell), planning=False).fixtures[0]
    both = replace(known.cell, fixtures=(*known.cell.fixtures, second))
    q, place = np.concatenate([known.second.q, right.q]), np.repeat([0, 1], (len(known.second.q), len(right.q)))
    two = RemainingErrors.of(before, both, Samples(q, place))
    white, names = two.white(Samples(q, place)), two.model.names
    assert two.stands is not None
    assert {"fixture_A_x", "fixture_B_x"} <= set(names)
    sizes = np.linalg.norm(two.root, axis=1)
    assert sizes[names.index("fixture_B_x")] > 2.5e-3 > sizes[names.index("fixture_A_x")]
    assert error_limit(two, white) < error_limit(two, white[: len(known.second.q)]) < before.at_most


@pytest.mark.slow
def test_the_files_are_named_between_which_a_gauge_was_moved(tmp_path):
    """Three runs of one mounting: places of the second and third less the first, as the model has them."""
    world = World.drawn(2)
    runs = [named(world.measure(tmp_path / d, BAR_LEFT, k), "monday").run for k, d in enumerate(("a", "b", "c"))]
    run, _, _ = load_sessions(run_sources(runs, None, None))
    note = "the gauge (or the base) was moved from session to session, 1.00 mm"
    finding = Finding(effect="session step", on="base", value=1e-3, std=5e-6, unit="m", note=note)
    for steps, told in (
        ([0, 0, 0, 1e-3, 0, 0], "between b/run.csv and c/run.csv"),
        ([1e-3, 0, 0, 1e-3, 0, 0], "between a/run.csv and b/run.csv"),
        ([1e-3, 0, 0, 0, 0, 0], "between a/run.csv and b/run.csv, and between b/run.csv and c/run.csv"),
    ):
        found = locate_session_step(np.array(steps, dtype=float), finding, run)
        assert found.note == f"the gauge (or the base) was moved {told}, 1.00 mm"
    assert found.between_sessions == ("a/run.csv", "b/run.csv")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "poses", "minutes"),
    [
        ([0, 30, 60, 90], 4, 0.5),
        ([0, 30, 60, 5, 35, 65], 6, 0.5),  # the clock of a second file begins anew
        ([9, 9, 9], 3, None),
        (None, 3, None),
    ],
)
def test_a_pose_takes_as_long_whether_it_is_in_the_first_file_or_the_second(times, poses, minutes):
    run = Of(samples=Of(t=None if times is None else np.array(times, dtype=float)))
    assert minutes_a_pose(run, poses) == minutes
