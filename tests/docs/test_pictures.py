"""No picture is older than what it shows; all of them are small, and on a page."""

import json
import re

import pytest

from docs.drawing.real_runs import on_page
from docs.make_pictures import INDEX, PICTURES, ROOT, digest, known, pictures, stale
from tests.docs.test_pages import PAGES

MOST_BYTES = 6_000_000


def test_no_picture_is_older_than_what_it_shows():
    assert stale() == [], "python -m docs.make_pictures"


def test_what_has_changed_makes_its_picture_stale(monkeypatch):
    one = next(pictures())
    monkeypatch.setattr(
        "docs.make_pictures.digest", lambda path: "other" if path == ROOT / one.shows[0] else digest(path)
    )
    assert one.name in stale()


def test_there_are_twenty_and_they_are_small():
    files = [p for p in PICTURES.iterdir() if p.is_file() and p != INDEX]
    assert {p.name for p in files} == set(known())
    assert len(files) >= 20
    assert sum(p.stat().st_size for p in files) <= MOST_BYTES


def test_every_picture_is_on_a_page():
    shown = "".join(PAGES.values())
    alone = [p.name for p in pictures() if not p.name.startswith("cell_")]  # the gallery has every cell
    assert [name for name in alone if f"pictures/{name}" not in shown] == []


def test_what_the_ur5_picture_shows_is_what_the_fit_judged():
    shown = json.loads((PICTURES / "shown" / "ur5.json").read_text())
    by_name = {s["name"]: s["validation_mean_mm"] for s in shown["stages"]}
    for name, errors in shown["errors_mm"].items():
        assert sum(errors) / len(errors) == pytest.approx(by_name[name], abs=2e-4), name


def shown(run):
    """What the pictures of a public run were drawn of."""
    return json.loads((PICTURES / "shown" / f"{run}.json").read_text())


def row_of(robot):
    """Published and own figures [mm] of a robot in the table of results, before and after."""
    (row,) = (line for line in PAGES["docs/results.md"].splitlines() if line.startswith(f"| {robot},"))
    *_, published, own, _ = row.split("|")
    return [[float(v) for v in re.findall(r"\d+\.\d+", cell.partition("(")[0])] for cell in (published, own)]


def test_the_page_of_results_says_what_the_fits_have_shown():
    ur5, ur10, panda = (shown(run) for run in ("ur5", "ur10", "panda"))
    validated = [s["validation_mean_mm"] for s in ur5["stages"]]
    held_out = [s["held_out_mean_mm"] for s in ur10["stages"]]
    placements = [v["all"] for v in panda["mean_mm"].values()]
    for robot, (before, *_, after) in {"UR5": validated, "UR10": held_out, "Panda": placements}.items():
        own = row_of(robot)[1]
        assert own == [pytest.approx(before, rel=2e-3), pytest.approx(after, abs=6e-4)], robot
    published, own = row_of("Panda")
    assert f"{own[1] - published[1]:.3f} mm better" in PAGES["docs/results.md"]
    assert f"{validated[0]:.2f} mm by the data sheet" in PAGES["README.md"]
    before, after = row_of("UR5")[0]
    assert f"Published: {before} mm before (the frame not fitted), {after} mm after" in PAGES["README.md"]


def test_the_pages_say_the_error_over_the_workspace_beside_that_at_poses_like_those_measured():
    """Whoever reads one figure alone takes it for the other."""
    results, readme = (" ".join(PAGES[page].split()) for page in ("docs/results.md", "README.md"))
    for robot, stated in shown("released").items():
        keys = ("nominal_anywhere_mm", "known_anywhere_mm", "at_most_mm", "where_measured_mm")
        before, after, most, near = (on_page(stated[key]) for key in keys)
        said = f"{before}, {after} mm | {most} mm | {near} mm |"
        assert any(
            said in row and row.lower().startswith(f"| {robot}") for row in PAGES["docs/results.md"].splitlines()
        )
    ur5, panda = shown("released")["ur5"], shown("released")["panda"]
    assert f"which programs are corrected by: {on_page(ur5['validation_mean_mm'])})" in results
    assert f"`robot.toml`: {on_page(panda['other_placements_mean_mm'])})" in results
    assert f"with its causes: {on_page(shown('released')['ur10']['held_out_mean_mm'])})" in results
    before, after, most = (on_page(ur5[key]) for key in ("nominal_anywhere_mm", "known_anywhere_mm", "at_most_mm"))
    assert f"{before} mm before and {after} mm after (rms" in readme
    assert f"below {most} mm" in readme
    told = f"{before} → {after} mm rms"
    before, after = (on_page(panda[key]) for key in ("nominal_anywhere_mm", "known_anywhere_mm"))
    assert f"{after} mm rms is stated ({before} before)" in PAGES["docs/tutorials/panda.md"]
    assert told in PAGES["docs/tutorials/ur5-real-run.md"]


def test_what_is_written_of_the_public_runs_is_no_worse_than_was_reached_before():
    best = {
        "ur5": ("validation_mean_mm", 0.0533),
        "panda": ("other_placements_mean_mm", 0.3325),
        "ur10": ("held_out_mean_mm", 0.0826),
    }
    for robot, (key, most) in best.items():
        assert shown("released")[robot][key] <= most, robot
