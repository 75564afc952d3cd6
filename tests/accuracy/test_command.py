"""``edbb accuracy`` as a user calls it: figures, files, messages and exit codes."""

import json
from typing import Any

import numpy as np
import polars as pl
import pytest

from planner.cell.reading import load_cell
from planner.workflow.identification import identify
from tests.accuracy.worlds import NAME, calibrated, poses, tracker_run, world
from tests.workflow.test_identify import edbb


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A tracker's run with its nests, a TriCal run, and the robot calibrated by that."""
    out = tmp_path_factory.mktemp("accuracy")
    (out / "v.csv").write_text(tracker_run(poses()))
    (out / "balls.csv").write_text(world().made.run_csv)
    (out / "cal").mkdir()
    calibrated(out / "cal")
    return out


def words(folder, *more):
    return "accuracy", folder / "v.csv", "--cell", f"{NAME}/tracker", *more


@pytest.mark.slow
def test_before_and_after_with_files(folder, browser):
    code, told, _ = edbb(*words(folder, "--model", folder / "cal" / "robot.toml", "-o", folder / "acc"))
    assert code == 0
    assert {p.name for p in (folder / "acc").iterdir()} == {
        "accuracy.json", "errors.csv", "manifest.json", "report.html"
    }  # fmt: skip
    content = json.loads((folder / "acc" / "accuracy.json").read_text())
    assert content["schema"] == "edbb-accuracy/1"
    table = pl.read_csv(folder / "acc" / "errors.csv")
    for when in ("before", "after"):
        size = table[f"{when}_mm"].to_numpy()
        parts = np.stack([table[f"{when}_{axis}_mm"].to_numpy() for axis in "xyz"])
        assert np.allclose(np.linalg.norm(parts, axis=0), size, atol=2e-6)
        assert content[when]["mean_mm"] == pytest.approx(size.mean(), abs=2e-6)
        assert content[when]["max_mm"] == pytest.approx(size.max(), abs=2e-6)
        assert content[when]["std_mm"] == pytest.approx(size.std(ddof=1), abs=2e-6)
        assert content[when]["p95_mm"] == pytest.approx(np.percentile(size, 95), abs=2e-6)
        assert f"{content[when]['mean_mm']:.3f}" in told
    assert content["after"]["mean_mm"] < 0.02 < 1 < content["before"]["mean_mm"]
    page = (folder / "acc" / "report.html").read_text()
    assert f"{content['after']['mean_mm']:.3f}" in page
    assert browser.check_report(folder / "acc" / "report.html") == ["accuracy"]  # judged.html.j2


@pytest.mark.slow
def test_with_a_plan_only_its_validation_poses_are_judged(folder):
    poses = [{"id": k, "q_deg": [0] * 6, "role": "validate" if k < 50 else "calibrate"} for k in range(120)]
    plan = {"schema": "edbb-plan/1", "plan_id": "0" * 12, "robot": NAME, "poses": poses}
    path = folder / "validate.json"
    path.write_text(json.dumps(plan | {"drives": [{"fixture": "", "travel": [], "waypoints": []}]}))
    content = json.loads(edbb(*words(folder, "--plan", path, "--json"))[1])
    whole = json.loads(edbb(*words(folder, "--json"))[1])
    assert (content["n_poses"], whole["n_poses"]) == (50, 120)
    assert any("50 poses: what 95 and 99 % of them stay within is known roughly" in n for n in content["notes"])


@pytest.mark.slow
def test_same_bytes_twice_and_json_alone_on_standard_output(folder):
    for name in ("one", "two"):
        assert edbb(*words(folder, "-o", folder / name))[0] == 0
    for path in (folder / "one").iterdir():
        assert path.read_bytes() == (folder / "two" / path.name).read_bytes()
    code, out, _ = edbb(*words(folder, "--json"))
    content = json.loads(out)
    assert code == 0
    assert content == json.loads((folder / "one" / "accuracy.json").read_text())
    assert content["after"] is None


def planned(folder, count=3):
    """A plan in which every pose of the TriCal run is centred ``count`` times, and that run with 2 µm of scatter."""
    run = pl.read_csv(folder / "balls.csv", comment_prefix="#")[:8].drop("t_s")
    often = run[np.repeat(np.arange(8), count)].with_columns(pose=pl.Series(np.arange(8 * count)))
    rng = np.random.default_rng(1)
    often = often.with_columns(**{f"d{axis}_mm": pl.Series(rng.normal(0, 2e-3, 8 * count)) for axis in "xyz"})
    (folder / "often.csv").write_text(
        f"# robot: {NAME}\n# master_mm: 6.350, 6.351, 6.350\n# master_mm: 6.350, 6.352, 6.350\n" + often.write_csv()
    )
    q = [{"id": k, "q_deg": [0] * 6, "role": "repeat"} | ({"repeats": k - k % count} if k % count else {})
         for k in range(8 * count)]  # fmt: skip
    drive = [{"fixture": "", "travel": [], "waypoints": []}]
    plan = {"schema": "edbb-plan/1", "plan_id": "0" * 12, "robot": NAME, "drives": drive, "poses": q}
    (folder / "plan.json").write_text(json.dumps(plan))
    return folder / "often.csv", folder / "plan.json"


@pytest.mark.slow
def test_precision_and_mastering(folder, browser):
    run, plan = planned(folder)
    code, out, told = edbb("accuracy", run, "--cell", f"{NAME}/trical", "--plan", plan, "--json", "-o", folder / "p")
    content = json.loads(out)
    assert (code, content["kind"], content["poses"], content["centrings"]) == (0, "precision", 8, 24)
    assert 1.5 < np.sqrt(np.mean(np.square(content["std_um"]))) < 2.5  # 48 degrees of freedom: 2 ± 0.2
    assert content["published"]["max_um"] == 2
    assert content["mastering"]["off_um"] == [[0, pytest.approx(1), 0], [0, pytest.approx(2), 0]]
    assert content["mastering"]["good"]
    assert {p.name for p in (folder / "p").iterdir()} == {
        "accuracy.json",
        "manifest.json",
        "report.html",
    }
    assert len(browser.check_report(folder / "p" / "report.html")) == 1
    assert not told
    _, told, _ = edbb("accuracy", run, "--cell", f"{NAME}/trical", "--plan", plan)
    assert "24 centrings of 8 poses" in told
    assert "2 checks of the master ball: at most 2.0 µm from 6.350 mm, drift from first to last 1.0 µm" in told


@pytest.mark.slow
def test_indicators_that_were_set_wrongly_are_told_where_their_run_is_identified(folder):
    text = (folder / "balls.csv").read_text()
    said: dict[str, Any] = {}
    for name, shown in (("well", "6.350, 6.351, 6.350"), ("wrongly", "6.350, 6.500, 6.350")):
        (folder / f"{name}.csv").write_text(f"# master_mm: {shown}\n{text}")
        cell = load_cell(f"{NAME}/trical")
        found = identify(folder / f"{name}.csv", cell=cell, release=False, no_trace=True)
        said[name] = found.content()["warnings"]
    assert not any("from 6.350 mm" in w for w in said["well"])
    assert any("at most 150.0 µm from 6.350 mm" in w for w in said["wrongly"])


def refused(*given):
    code, out, told = edbb("accuracy", *given)
    assert (code, out) == (2, "")
    assert told.count("\n") == 1
    return told


@pytest.mark.slow
def test_what_does_not_belong_together_is_refused(folder):
    tracker, trical, model = f"{NAME}/tracker", f"{NAME}/trical", folder / "cal" / "robot.toml"
    out = ("-o", folder / "never")
    assert "has readings 'ball', but the gauge 'tracker'" in refused(folder / "balls.csv", "--cell", tracker, *out)
    assert "has readings 'x_mm, y_mm, z_mm', but the gauge 'trical'" in refused(
        folder / "v.csv", "--cell", trical, *out
    )
    assert "its gauge is 'edbb'" in refused(folder / "v.csv", "--cell", "kuka-kr6-r700/edbb", *out)
    assert "give it with --plan" in refused(folder / "balls.csv", "--cell", trical, *out)
    other = load_cell("comau-nj130/edbb").robot.path
    assert "model of comau-nj130" in refused(folder / "v.csv", "--cell", tracker, "--model", other, *out)
    foreign = folder / "foreign.csv"
    foreign.write_text(tracker_run(poses()).replace(f"# robot: {NAME}", "# robot: ur10"))
    assert "was measured on 'ur10'" in refused(foreign, "--cell", tracker, "--model", model, *out)
    bare = folder / "bare.csv"
    bare.write_text(tracker_run(poses(), nests=False))
    assert "takes 3 nests" in refused(bare, "--cell", tracker, *out)
    once = folder / "once.json"
    once.write_text(planned(folder)[1].read_text().replace('"repeats"', '"never"'))
    assert "no pose was centred more than once" in refused(folder / "often.csv", "--cell", trical, "--plan", once, *out)
    assert not (folder / "never").exists()
