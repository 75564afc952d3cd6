"""Before and after calibration, against errors that the generator's own arm has at the same poses."""

from dataclasses import replace

import numpy as np
import pytest

from planner.accuracy.reference_frame import nest_frame
from planner.accuracy.validation import validate_robot
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.units import MM, UM
from planner.runs.loader import load_run
from planner.runs.run import Readings, ReferenceReadings, Run, Samples, read_reference_readings
from planner.runs.writer import run_text
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_truth
from tests.accuracy.worlds import NAME, calibrated, loaded, poses, tracker_run, world


@pytest.fixture(scope="module")
def cell():
    return load_cell(f"{NAME}/tracker")


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "v.csv"
    path.write_text(tracker_run(poses()))
    return path


def judged(cell, path, model=None):
    return validate_robot(cell, load_run(path, 6), read_reference_readings(path), model)


def test_before_is_the_data_sheets_arm_where_the_cell_has_it(cell, run_file):
    """True points seen from the true nests, brought to where the nests should be, less the nominal arm's points."""
    w, q = world(), poses()
    p_W = (w.points(q) - w.p_BW) @ w.R_BW
    R, p = w.arm.flange(q)
    wanted = p_W + np.array([536.32, 21.901, 58.349]) / 1e3 - (p + R @ w.bench.tool)
    found = judged(cell, run_file)
    assert np.allclose(found.before.error, wanted, atol=1e-8)
    assert found.before.figures.mean == pytest.approx(np.linalg.norm(wanted, axis=1).mean(), abs=1e-8)
    assert found.after is None
    assert found.before.figures.mean > 1 * MM


def test_after_the_calibration_on_the_balls_next_to_nothing_is_left(cell, run_file, tmp_path):
    """The artifact's place, which the calibration found, stands for the nests; nothing was fitted to these poses."""
    found = judged(cell, run_file, calibrated(tmp_path))
    assert found.after.figures.mean < 20 * UM
    assert found.after.figures.largest < 60 * UM
    (note,) = found.notes
    w = world()
    turned = np.rad2deg(np.arccos((np.trace(w.R_BW) - 1) / 2))
    assert f"{turned:.2f}° away from where the cell says" in note


def test_without_the_place_that_was_found_the_base_counts_as_error(cell, run_file, tmp_path):
    model = calibrated(tmp_path)
    (tmp_path / "identification.json").unlink()
    found = judged(cell, run_file, model)
    assert found.after.figures.mean > 1 * MM
    assert any("identification.json is missing" in n for n in found.notes)


@pytest.mark.slow
def test_a_bars_calibration_is_placed_by_poses_that_nothing_is_judged_by(cell, run_file, tmp_path):
    """A bar knows nothing of nests, nor of the reflector; and it was measured with a lighter tool."""
    model = calibrated(tmp_path, "edbb")
    alone = judged(cell, run_file, model)
    assert alone.after.figures.mean > 1 * MM
    assert any("says nothing of where the nests stand" in n for n in alone.notes)
    others = loaded(tracker_run(poses(30, seed=8), noise=5e-6))
    found = validate_robot(cell, load_run(run_file, 6), read_reference_readings(run_file), model, others)
    assert found.after.figures.mean < 100 * UM
    assert any("30 poses of the plan to calibrate with placed robot and reflector" in n for n in found.notes)
    assert any("calibrated with a tool of 1.3 kg, judged with one of 6 kg" in n for n in found.notes)


@pytest.mark.slow
def test_a_calibration_by_the_tracker_itself_stands_by_its_own_frame(cell, run_file, tmp_path):
    found = judged(cell, run_file, calibrated(tmp_path, "tracker"))
    assert found.after.figures.mean < 20 * UM
    assert found.floor.nests == 0.0 < judged(cell, run_file).floor.nests


def test_the_simulated_tracker_reads_its_nests_as_well(cell, tmp_path):
    """The chain's own simulation: errors of base and robot come back through the lines above its columns."""
    q = poses(40)
    samples = Samples(q, np.zeros(len(q), dtype=int))
    truth = draw_truth(cell, 4)
    run = simulate_run(cell, "0" * 12, samples, replace(truth, errors=0 * truth.errors), 4)
    path = tmp_path / "s.csv"
    path.write_text(run.comments() + run_text(run))
    said = read_reference_readings(path)
    assert [n for n, _ in said.nests] == ["N1", "N2", "N3"]
    found = judged(cell, path)
    assert found.frame.misses.max() < 5 * cell.gauge.noise
    assert 0.3 * found.floor.all < found.before.figures.mean < 2.5 * found.floor.all


def test_a_tracker_that_moved_between_its_nests_and_the_poses_is_not_hidden(cell, run_file, tmp_path):
    """The frame comes from the nests alone: poses shifted by 0.5 mm show as 0.5 mm."""
    model = calibrated(tmp_path)
    run = load_run(run_file, 6)
    moved = replace(run, readings=Readings(position=run.readings.position + np.array([5e-4, 0.0, 0.0])))
    found = validate_robot(cell, moved, read_reference_readings(run_file), model)
    assert found.after.figures.mean == pytest.approx(5e-4, abs=2e-5)


@pytest.mark.slow
def test_the_floor_is_what_a_true_model_shows(cell):
    """Nests and points read with noise, over and over, by an arm without errors: the rms of what is seen."""
    q, noise, turn = poses(), 15e-6, np.diag([-1.0, -1.0, 1.0])
    home, p_BG = nest_frame(cell).p_BW, np.array([2.5, 0.0, 0.4])
    x, nests, rng = cell.map_position(q), np.array([n.p_WN for n in cell.nests]), np.random.default_rng(3)
    square = []
    for _ in range(200):
        read = (nests + home - p_BG) @ turn + noise * rng.standard_normal((3, 3))
        ready = replace(cell, nests=tuple(replace(n, p_GN=p) for n, p in zip(cell.nests, read, strict=True)))
        seen = (x - p_BG) @ turn + noise * rng.standard_normal(x.shape)
        found = validate_robot(
            ready, Run("made", Samples(q, np.zeros(len(q), dtype=int)), Readings(position=seen)), ReferenceReadings()
        )
        square.append((found.before.error**2).sum(axis=1).mean())
    floor = found.floor
    assert floor.tracker == pytest.approx(np.sqrt(3) * noise)
    wanted = np.hypot(floor.nests, floor.tracker)
    assert np.sqrt(np.mean(square)) == pytest.approx(wanted, rel=0.1)  # six numbers of a frame, 200 times: ± 3 %
    assert floor.nests > floor.tracker
    assert floor.all > wanted


def test_what_cannot_be_judged_is_told(cell, run_file, tmp_path):
    bare = tmp_path / "bare.csv"
    bare.write_text(tracker_run(poses(), nests=False))
    with pytest.raises(InputError, match=r"takes 3 nests.*read_mm is missing for N1, N2, N3.*# nest_mm: NAME"):
        judged(cell, bare)
    short = tmp_path / "short.csv"
    short.write_text(tracker_run(poses()[:5]))
    with pytest.raises(InputError, match=r"short: 5 poses are too few.* at least 10"):
        judged(cell, short)
    with pytest.raises(InputError, match="needs the tracker's x_mm"):
        validate_robot(cell, loaded(world().made.run_csv), read_reference_readings(run_file))
    with pytest.raises(InputError, match=r"model of comau-nj130, but .* has the robot kuka-kr6-r700"):
        judged(cell, run_file, load_cell("comau-nj130/edbb").robot.path)
    strange = tmp_path / "strange.csv"
    strange.write_text(tracker_run(poses()).replace("# nest_mm: N2", "# nest_mm: N7"))
    with pytest.raises(InputError, match=r"nest 'N7' of the run is not in .*\(there: N1, N2, N3\)"):
        judged(cell, strange)
    twice = tmp_path / "twice.csv"
    twice.write_text(tracker_run(poses()).replace("# nest_mm: N2", "# nest_mm: N1"))
    with pytest.raises(InputError, match="read twice"):
        judged(cell, twice)


@pytest.mark.slow
def test_exchanged_nests_are_noticed(cell, run_file, tmp_path):
    text = run_file.read_text()
    assert "nest_mm: N1" in text
    path = tmp_path / "run.csv"
    path.write_text(
        text.replace("nest_mm: N1", "nest_mm: NX").replace("nest_mm: N2", "nest_mm: N1").replace("NX", "N2")
    )
    with pytest.raises(InputError, match="whether two were exchanged"):
        judged(cell, path)
