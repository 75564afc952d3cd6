"""The commands as a user runs them: plan, simulate, evaluate, export; the same bytes every time."""

import json
import re

import pytest

from tests.circular.conftest import ARC, cell_file
from tests.command import edbb


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("command")
    cell = cell_file(place, ARC + "speed_mm_s = 150\n")
    done = edbb("plan", cell, "-o", place / "one", "--dialect", "krl")
    assert done.returncode == 0, done.stderr
    assert "circular test on 1 circle" in done.screen
    assert f"edbb simulate {place}/one/plan.json -o run.csv" in done.screen
    assert f"edbb circular run.csv --plan {place}/one/plan.json -o circular" in done.screen
    return place


@pytest.mark.slow
def test_the_folder(folder):
    one = folder / "one"
    plan = json.loads((one / "plan.json").read_text())
    assert plan["kind"] == "circular"
    assert plan["circles"][0]["off_circle_um"] < 10.0
    assert {p["file"] for p in plan["programs"]} == {f.name for f in one.iterdir() if f.suffix in (".src", ".dat")}
    head = (one / "trajectory.csv").read_text().split("\n", 1)[0]
    assert head == "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,length_mm"
    page = (one / "report.html").read_text()
    assert plan["plan_id"] in page
    assert not re.search(r"\bnan\b", page.split("<script", 1)[0].lower())


@pytest.mark.long
def test_the_same_bytes_on_two_threads(folder):
    assert edbb("plan", folder / "circular.toml", "-o", folder / "two", "--dialect", "krl", threads="2").returncode == 0
    for path in (p for p in (folder / "one").rglob("*") if p.is_file() and p.name != "timings.json"):
        assert path.read_bytes() == (folder / "two" / path.relative_to(folder / "one")).read_bytes(), path.name


@pytest.mark.long
def test_its_page_in_a_browser(browser, folder):
    assert browser.check_report(folder / "one" / "report.html") == ["view", "circle_1"]  # circular_plan.html.j2


@pytest.mark.slow
def test_an_exported_program_is_the_planned_one(folder):
    one = folder / "one"
    main = next(f for f in one.glob("*.src") if not f.stem[-3:].isdigit())
    out = folder / "again"
    out.mkdir()
    done = edbb("export", one / "plan.json", "--dialect", "krl", "-o", out / main.name)
    assert done.returncode == 0, done.stderr
    for path in [*one.glob("*.src"), *one.glob("*.dat")]:
        assert path.read_bytes() == (out / path.name).read_bytes()


@pytest.mark.slow
def test_a_simulated_run_is_evaluated(folder, browser):
    truth = folder / "truth.toml"
    truth.write_text(
        'schema = "edbb-truth/1"\n[errors]\na2_mm = 0.5\n[noise]\nrepeatability_mm = 0.0\ngauge_um = 0.1\n'
    )
    run, plan = folder / "run.csv", folder / "one" / "plan.json"
    done = edbb("simulate", plan, "--truth", truth, "-o", run)
    assert done.returncode == 0, done.stderr
    done = edbb("circular", run, "--plan", plan, "-o", folder / "found", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == json.loads((folder / "found" / "circular.json").read_text())
    (circle,) = found["circles"]
    assert [p["direction"] for p in circle["paths"]] == ["ccw", "cw"]
    assert circle["H_um"] < 3.0 < circle["G_b_um"] < 100.0
    assert browser.check_report(folder / "found" / "report.html") == ["polar_1", "radial_1"]  # circular.html.j2
    said = edbb("circular", run, "--plan", plan, "-o", folder / "found")
    assert "G(b)" in said.stdout


@pytest.mark.slow
def test_a_plan_without_its_cell_is_refused(folder, tmp_path):
    lonely = tmp_path / "plan.json"
    lonely.write_bytes((folder / "one" / "plan.json").read_bytes())
    done = edbb("export", lonely, "--dialect", "krl", "-o", "-")
    assert done.returncode == 2
    assert "cell.toml is missing" in done.screen
    (tmp_path / "cell.toml").write_text(
        (folder / "one" / "cell.toml").read_text().replace("radius_mm = 350.0", "radius_mm = 351.0")
    )
    done = edbb("export", lonely, "--dialect", "krl", "-o", "-")
    assert done.returncode == 2
    assert "misses circle arc" in done.screen
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_a_run_and_a_plan_that_do_not_belong_together_are_refused(folder, tmp_path):
    one, run = folder / "one", tmp_path / "run.csv"
    assert edbb("simulate", one / "plan.json", "-o", run).returncode == 0
    plan_id = json.loads((one / "plan.json").read_text())["plan_id"]
    text = run.read_text()
    assert plan_id in text
    run.write_text(text.replace(plan_id, "0123456789ab"))
    done = edbb("circular", run, "--plan", one / "plan.json", "-o", tmp_path / "found")
    assert done.returncode == 2
    assert f"belongs to the plan 0123456789ab, but {one / 'plan.json'} is the plan {plan_id}" in done.screen
    changed = (one / "plan.json").read_text().replace('"robot": "', '"robot": "other-')
    (tmp_path / "plan.json").write_text(changed)
    (tmp_path / "cell.toml").write_bytes((one / "cell.toml").read_bytes())
    run.write_text(text)
    done = edbb("circular", run, "--plan", tmp_path / "plan.json", "-o", tmp_path / "found")
    assert done.returncode == 2
    assert "for other-" in done.screen
    assert not (tmp_path / "found").exists()
