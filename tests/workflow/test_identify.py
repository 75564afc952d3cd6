"""From a plan over a simulated run to a calibrated robot and a corrected program, and what goes wrong on the way."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.content_hashes import with_hashes
from planner.common.errors import InputError
from planner.common.summary import SCREEN_LINES
from planner.documents.baseline import Baseline
from planner.kinematics.robot_reader import load_robot
from planner.runs.writer import save_run
from planner.workflow.identification import identify
from planner.workflow.plan_use import simulate
from tests import command
from tests.identification.few_draws import few_draws
from tests.simulation.generator.arm import Arm
from tests.simulation.made import truth_file, wide_plan

TRUTH = """[errors]
a2_mm = 1.2
theta3_deg = 0.1
alpha1_urad = -1500
fixture_A_x_mm = -1.5
fixture_A_y_mm = 0.7
zero_mm = 0.3
[noise]
gauge_um = 1
repeatability_mm = 0.01
"""
ZERO_M = 1e-3  # what the unknown zero of the bar may add to its range
ERRORS = {"a2": 1.2e-3, "theta3": np.deg2rad(0.1), "alpha1": -1500e-6}
TARGETS = np.array([[10, -80, 95, 5, 40, 0], [-20, -95, 100, 20, 50, 30], [35, -60, 80, -15, 60, -40.0]])
PROGRAM = """&ACCESS RVP
DEF part ( )
  ; a remark stays
  PTP {A1 10,A2 -80,A3 95,A4 5,A5 40,A6 0} C_PTP
  LIN {X 500,Y 100,Z 400,A 0,B 90,C 0,S 2,T 35}
END
"""


def edbb(*words):
    """The command line in this process: exit code, standard output, standard error."""
    done = command.edbb(*words)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a plan, its simulated run and what was identified from it."""
    folder = tmp_path_factory.mktemp("made")
    plan = wide_plan(folder, mixed=True)
    code, _, told = edbb("simulate", plan, "-o", folder / "run.csv", "--truth", truth_file(folder, TRUTH))
    assert code == 0, told
    with few_draws():
        code, told, notes = edbb("identify", folder / "run.csv", *_cell(folder), "-o", folder / "out", "--no-trace")
    assert code == 0, notes
    (folder / "screen.txt").write_text(told)
    return folder


@pytest.fixture
def identified(made, tmp_path):
    """A copy of all that."""
    return Path(shutil.copytree(made, tmp_path / "made"))


@pytest.fixture
def measured(identified):
    """The same before it was identified."""
    shutil.rmtree(identified / "out")
    return identified


def _cell(folder):
    return "--cell", folder / "cell.toml", "--plan", folder / "plan.json"


@pytest.mark.slow
def test_the_run_says_that_it_is_simulated(measured):
    lines = (measured / "run.csv").read_text().splitlines()
    assert "# plan_id: 0123456789ab" in lines
    assert "# robot: kuka-kr6-r700" in lines
    assert "# truth: a2_mm = 1.2" in lines
    assert "# truth: gauge_um = 1" in lines
    code, out, _ = edbb("simulate", measured / "plan.json", "-o", "-", "--truth", measured / "truth.toml")
    assert code == 0
    assert out == (measured / "run.csv").read_text()
    same = ("simulate", measured / "plan.json", "-o", "-", "--truth", measured / "run.csv")
    again = edbb(*same)[1].splitlines()
    assert [x for x in again if x[0] == "#"] == [x for x in lines if x[0] == "#"], "a run says what is true"
    assert "# truth: a2_mm = 1.45" in edbb(*same, "--change", "a2_mm=0.25")[1].splitlines()
    assert edbb("simulate", measured / "plan.json", "-o", measured / "run.parquet")[0] == 0
    assert (measured / "run.parquet").stat().st_size > 1000


def test_a_plan_becomes_a_calibrated_robot(identified):
    said = json.loads((identified / "out" / "identification.json").read_text())
    assert said["schema"] == "edbb-identification/1"
    stages = {s["name"]: s for s in said["stages"]}
    assert list(stages)[:3] == ["nominal", "frames", "geometry"]
    assert said["n_samples"] == 64  # 60 poses and 4 repeats; 8 more are kept out
    before, after = (stages[k]["validation"]["rms_mm"] for k in ("frames", "geometry"))
    assert after < 0.015 < 0.05 < before  # repeatability alone is some 5 µm along the bar
    values = {p["name"]: p for p in said["parameters"]}
    for name, true in (("a2", 1.2), ("alpha1", np.rad2deg(-1500e-6))):
        p = values[name]
        if p["identifiable"] and not p["absorbs"]:
            assert abs(p["value"] - p["nominal"] - true) < 5 * p["std"]
    assert (identified / "out" / "report.html").stat().st_size > 10_000
    assert (identified / "out" / "residuals.csv").read_text().count("\n") >= 64
    assert not list(identified.glob(".*"))  # no draft is left


def test_the_screen_is_short_lines_of_one_fact(identified):
    lines = (identified / "screen.txt").read_text().splitlines()
    facts = [line for line in lines if not re.match(r"  (note|next|written)", line) and "edbb " not in line]
    assert [line for line in facts if len(line) > 120] == []
    assert [line for line in facts if len(line.split()) > 25] == []
    assert len(lines) <= SCREEN_LINES
    text = " ".join(facts)
    for said in (
        "verdict     95 of 100 targets within",
        "; with any other tool",
        "found       Lengths and angles of the arm",
    ):
        assert said in text


def test_the_calibrated_robot_is_the_true_one(identified):
    found, arm = load_robot(str(identified / "out" / "robot.toml")), Arm.from_toml("kuka-kr6-r700")
    q = np.deg2rad(TARGETS)
    R, p = arm.flange(q, ERRORS)
    tool = np.array([0.03, 0, 0.11])
    motion = found.chain.forward(found.theta(q))
    apart = motion.x.T + np.einsum("ijn,j->ni", motion.R, tool) - p - R @ tool
    assert np.linalg.norm(apart - apart.mean(axis=0), axis=1).max() < 0.12e-3  # a shift of all is the fixture's
    nominal = found.nominal_robot.chain.forward(found.theta(q)).x.T - arm.flange(q)[1]
    assert np.abs(nominal).max() < 1e-9  # the file still knows what the controller believes


@pytest.mark.slow
def test_a_program_is_corrected(identified):
    (identified / "part.src").write_text(PROGRAM)
    frames = ("--tool", "0,0,100,0,0,0", "--base", "0,0,0,0,0,0")
    model = ("--model", identified / "out" / "robot.toml")
    code, out, told = edbb("compensate", identified / "part.src", *model, *frames, "-o", "-", "-v")
    assert code == 0, told
    assert "1 joint target and 1 pose corrected" in told
    assert "mm  rms with another tool (0.0, 0.0, 100.0) mm" in told
    assert out != PROGRAM
    lines = out.splitlines()
    assert lines[2].startswith("; edbb-compensated ")
    assert lines[3].endswith("never correct it again.")
    kept = [line for line in lines[:2] + lines[4:] if "{" not in line]
    assert kept == [line for line in PROGRAM.splitlines() if "{" not in line]
    code, _, told = edbb("compensate", identified / "part.src", *model, "--strict", "-o", identified / "new.src")
    assert code == 2
    assert "part.src:5" in told or "line 5" in told  # a pose without tool and base
    assert not (identified / "new.src").exists()
    code, told, _ = edbb("compensate", identified / "part.src", *model, "-o", identified / "new.src")
    assert code == 5
    assert "part.src:5" in told or "line 5" in told
    corrected = (identified / "new.src").read_text().splitlines()
    assert PROGRAM.splitlines()[4] in corrected  # the pose stands as it was
    assert PROGRAM.splitlines()[3] not in corrected  # the joint target is corrected
    before, after = map(float, re.search(r"tool error  (\S+) → (\S+) mm  rms at the 1 target", told).groups())
    assert after < 0.3 * before


@pytest.mark.slow
def test_corrected_joints_bring_the_found_robot_where_the_nominal_should_be(identified):
    header = ",".join(f"q{k}_deg" for k in range(1, 7))
    np.savetxt(identified / "t.csv", TARGETS, "%.6f", ",", header=header, comments="")
    model = identified / "out" / "robot.toml"
    code, _, told = edbb("compensate", identified / "t.csv", "--model", model, "-o", identified / "new.csv")
    assert code == 0, told
    mark, more, axes, *rows = (identified / "new.csv").read_text().splitlines()
    assert mark.startswith("# edbb-compensated ")
    assert more.startswith("# ")
    assert axes == "# axes_of: model"
    new = np.deg2rad(np.loadtxt(rows, delimiter=",", skiprows=1))
    _, wanted = Arm.from_toml("kuka-kr6-r700").flange(np.deg2rad(TARGETS))
    found = load_robot(str(model))
    there = found.chain.forward(found.theta(new)).x.T
    assert np.linalg.norm(there - wanted, axis=1).max() < 1e-7


@pytest.mark.slow
def test_a_calibration_whose_line_ends_were_changed_by_git_corrects_as_before(identified):
    (identified / "part.src").write_text(PROGRAM)
    words = ("compensate", identified / "part.src", "--model", identified / "out" / "robot.toml", "-o", "-")
    cell = load_cell(str(identified / "cell.toml"))
    before, root = edbb(*words), Baseline.read(identified / "out", cell).root
    for path in (p for p in (identified / "out").iterdir() if p.suffix in (".json", ".toml", ".csv")):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert edbb(*words) == before
    assert "tool error  unknown" not in before[2]
    np.testing.assert_array_equal(Baseline.read(identified / "out", cell).root, root)


@pytest.mark.slow
def test_a_correction_that_is_expected_to_do_harm_is_refused(identified):
    """The robot's file stays, but what is known says that its values are ten times as far off as the nominal ones."""
    (identified / "part.src").write_text(PROGRAM)
    words = ("--model", identified / "out" / "robot.toml", "-o", identified / "new.src")
    known = identified / "out" / "expected_error.json"
    whole = json.loads(known.read_text())
    worse = whole | {"released": [10 * v for v in whole["nominal"]]}
    known.write_text(json.dumps(with_hashes(worse)))
    code, _, told = edbb("compensate", identified / "part.src", *words)
    assert code == 3
    assert "nothing is written" in told
    assert not (identified / "new.src").exists()
    known.write_text(json.dumps(worse))  # the hashes are those of the other values
    exchanged = with_hashes(whole | {"robot_sha256": "0"})
    for content, said in (
        (worse, r"was changed by hand since edbb wrote it \(released\)"),
        (exchanged, "belongs to another"),
    ):
        known.write_text(json.dumps(content))
        code, _, told = edbb("compensate", identified / "part.src", *words)
        assert code == 2
        assert re.search(said, told)
        assert not (identified / "new.src").exists()
        code, _, told = edbb("compensate", identified / "part.src", *words[:2], "-o", "-", "--force")
        assert code == 5  # lines without a target of their own are left
        assert re.search(f"tool error  unknown: .*{said}", told)
    known.write_text(json.dumps(with_hashes(whole | {"nominal": [0.0]})))
    code, _, told = edbb("compensate", identified / "part.src", *words)
    assert code == 2
    assert "numbers each" in told
    known.unlink()
    code, out, _ = edbb("compensate", identified / "part.src", *words)
    assert code == 5  # the pose without tool and base stays
    assert "tool error  unknown: no expected_error.json lies beside robot.toml" in out


def test_a_controller_that_corrects_itself_is_refused(identified):
    text = (identified / "cell.toml").read_text().replace("[controller]", '[controller]\naccuracy_model = "on"')
    (identified / "cell.toml").write_text(text)
    (identified / "part.src").write_text(PROGRAM)
    words = ("--model", identified / "out" / "robot.toml", "--cell", identified / "cell.toml", "-o", "-")
    code, out, told = edbb("compensate", identified / "part.src", *words)
    assert (code, out) == (2, "")
    assert "accuracy_model" in told


def test_a_nominal_robot_is_no_model(tmp_path):
    (tmp_path / "part.src").write_text(PROGRAM)
    model = load_robot("kuka-kr6-r700").path
    code, _, told = edbb("compensate", tmp_path / "part.src", "--model", model, "-o", tmp_path / "new.src")
    assert code == 2
    assert "no calibrated robot" in told
    code, _, told = edbb("compensate", tmp_path / "part.src", "--model", model, "--tool", "1,2", "-o", "-")
    assert code == 2


def edited(text, row, column, value):
    """The run with one field replaced; row 0 is the first of the data."""
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    at, fields = lines[first].split(",").index(column), lines[first + 1 + row].split(",")
    fields[at] = value
    lines[first + 1 + row] = ",".join(fields)
    return "\n".join(lines) + "\n"


def without(text, column):
    """The run without a column."""
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    at = lines[first].split(",").index(column)
    rows = [",".join(f for i, f in enumerate(line.split(",")) if i != at) for line in lines[first:]]
    return "\n".join([*lines[:first], *rows]) + "\n"


BAD = {
    "another plan": (lambda t: t.replace("0123456789ab", "ba9876543210"), ["ba9876543210", "0123456789ab"]),
    "another robot": (lambda t: t.replace("# robot: kuka-kr6-r700", "# robot: comau-nj130"), ["comau-nj130"]),
    "a pose that is not planned": (lambda t: edited(t, 3, "pose", "999"), ["999", "plan.json"]),
    "no length": (lambda t: without(t, "length_mm"), ["length_mm"]),
    "a joint missing": (lambda t: without(t, "q4_deg"), ["q4_deg", "6 joints"]),
    "a joint too many": (lambda t: t.replace("direction6", "q7_deg"), ["q7_deg", "6 joints"]),
    "not a number": (lambda t: edited(t, 2, "length_mm", "nan"), ["length_mm", "finite"]),
    "text": (lambda t: edited(t, 2, "q2_deg", "abc"), ["q2_deg", "'abc'"]),
    "an unknown fixture": (lambda t: t.replace(",A,", ",C,"), ["fixture 'C'"]),
    "too few": (lambda t: "\n".join(t.splitlines()[:-64]) + "\n", ["too few"]),
}


@pytest.mark.parametrize("what", BAD)
def test_a_bad_run_is_told_and_nothing_is_written(measured, what):
    change, parts = BAD[what]
    run = measured / "bad.csv"
    run.write_text(change((measured / "run.csv").read_text()))
    before = sorted(p.name for p in measured.iterdir())
    code, out, told = edbb("identify", run, *_cell(measured), "-o", measured / "out", "--no-trace")
    assert code == 2, told
    assert out == ""
    assert all(part in told for part in parts), told
    assert told.count("\n") <= 2  # a sentence, no traceback
    assert sorted(p.name for p in measured.iterdir()) == before


def test_a_run_that_measured_elsewhere_than_its_plan_says_is_refused(measured):
    plan = json.loads((measured / "plan.json").read_text())
    plan["poses"][3]["fixture"] = "B"
    (measured / "plan.json").write_text(json.dumps(plan))
    code, _, told = edbb("identify", measured / "run.csv", *_cell(measured), "-o", measured / "out")
    assert code == 2
    said = f"pose {plan['poses'][3]['id']} was measured at fixture 'A', but"
    assert said in told
    assert "run.csv, line " in told
    assert not (measured / "out").exists()


def test_a_plan_of_circles_is_named(measured):
    plan = json.loads((measured / "plan.json").read_text())
    (measured / "plan.json").write_text(json.dumps({**plan, "kind": "circular"}))
    code, _, told = edbb("identify", measured / "run.csv", *_cell(measured), "-o", measured / "out")
    assert code == 2
    assert "is a plan of the kind 'circular'" in told


def test_a_failing_fit_leaves_the_old_result(identified):
    old = {p: p.read_bytes() for p in (identified / "out").rglob("*") if p.is_file()}
    bad = identified / "bad.csv"
    bad.write_text(edited((identified / "run.csv").read_text(), 2, "length_mm", "nan"))
    code, _, _ = edbb("identify", bad, *_cell(identified), "-o", identified / "out", "--no-trace")
    assert code == 2
    assert {p: p.read_bytes() for p in (identified / "out").rglob("*") if p.is_file()} == old


def test_simulating_a_broken_plan_leaves_nothing(tmp_path):
    (tmp_path / "plan.json").write_text("{}")
    code, _, told = edbb("simulate", tmp_path / "plan.json", "-o", tmp_path / "run.csv")
    assert code == 2
    assert "plan.json" in told
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.slow
def test_what_was_simulated_is_identified_in_the_cell_of_its_plan(tmp_path):
    plan = wide_plan(tmp_path, "kuka-kr6-r700", 30, 4, 0)
    simulated = simulate(plan, seed=1)
    found = identify(simulated, plan=plan, no_trace=True, release=False)
    assert repr(found.cell) == f"Cell('{tmp_path / 'cell.toml'}', robot='kuka-kr6-r700', gauge='edbb')"
    same = identify(simulated.run, cell=tmp_path / "cell.toml", plan=plan, no_trace=True, release=False)
    assert found.to_json() == same.to_json()
    with pytest.raises(InputError, match="which cell was measured in"):
        identify(simulated)


@pytest.mark.slow
def test_a_driven_plan_is_identified_and_judged_on_stretches_kept_out(tmp_path):
    fast = [("tool_speed_mm_min = 1000", "tool_speed_mm_min = 20000")]
    plan = wide_plan(tmp_path, "comau-nj130", 30, 4, 0, fast)
    run = simulate(plan, truth=truth_file(tmp_path, TRUTH)).run
    save_run(run, tmp_path / "run.csv")
    found = identify([tmp_path / "run.csv"], plan=plan, release=False, no_trace=True)
    calibration, aside = found.calibration, np.isin(run.samples.pose, range(31, 35))
    assert 200 < aside.sum() < len(run) / 4
    length = run.readings.length  # the plan is made by hand: on its way the bar leaves its range
    readable = (length > 0.3 - ZERO_M) & (length < 0.52 + ZERO_M)
    assert len(run) / 2 < readable.sum() < len(run)
    assert len(calibration.run) == (readable & ~aside).sum()
    assert any(
        "cannot have read (pulled off, at a stop, or mistyped), and cut out" in w for w in calibration.run.warnings
    )
    assert calibration.split.by == "stretch"
    stages = {s.name: s.validation.rms for s in calibration.stages}
    assert stages["geometry"] < 0.02e-3 < 0.2e-3 < stages["frames"]
