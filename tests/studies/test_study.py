"""The files of a study hold together, come out the same twice, and agree with numbers found another way."""

import re

import numpy as np
import polars as pl
import pytest
from markupsafe import escape

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.result_folder import MANIFEST
from planner.studies.cell_study import NAMES, StudyResult, study
from planner.studies.pictures import draw_curves
from tests.studies.conftest import small_study


@pytest.mark.slow
def test_every_file_is_there_and_nothing_else(done):
    assert sorted(p.name for p in done[0].iterdir()) == sorted((*NAMES, MANIFEST))


@pytest.mark.long
def test_the_same_seed_gives_the_same_bytes(done, tmp_path, monkeypatch):
    small_study(tmp_path, monkeypatch)
    for name in NAMES:
        assert (tmp_path / name).read_bytes() == (done[0] / name).read_bytes(), name


@pytest.mark.slow
def test_pictures_name_neither_date_nor_program(done):
    pictures = [(done[0] / "fixture_map.png").read_bytes()]
    charts = ("fixtures_needed", "identifiability", "index_curve", "sensitivity")
    pictures += [StudyResult(done[1]).plot(name).png for name in charts]
    for data in pictures:
        assert data[:4] == b"\x89PNG"
        assert not re.search(rb"tEXt|tIME|iTXt", data)
    with pytest.raises(InputError, match="no chart 'map'"):
        StudyResult(done[1]).plot("map")


@pytest.mark.slow
def test_the_page_names_robot_and_gauge_and_says_what_was_found(done):
    page, basis = (done[0] / "report.html").read_text().replace("\u00a0", " "), done[1].basis
    assert f"robot {basis.cell.robot.name} · {basis.cell.gauge.describe(basis.cell)}" in page
    assert all(
        str(escape(line.split(maxsplit=1)[1][-40:])) in page for line in done[1].overview().text().splitlines()[1:]
    )
    assert not re.search(r"20\d\d-\d\d-\d\d", page.partition("<script>")[0])  # its date is the file's


@pytest.mark.slow
def test_the_page_in_a_browser(browser, done):
    shown = browser.check_report(done[0] / "report.html")  # overview.html.j2
    assert shown == ["fixtures_needed", "identifiability", "index_curve", "sensitivity"]


@pytest.mark.slow
def test_tables_and_summary_say_the_same(done, told):
    folder = done[0]
    seen = pl.read_csv(folder / "identifiability.csv")
    assert seen.filter("seen")["parameter"].to_list() == told["parameters"]
    assert seen.filter(~pl.col("seen"))["parameter"].to_list() == [d["name"] for d in told["dropped"]]
    places = pl.read_csv(folder / "fixture_map.csv")
    best = places.filter("best")
    assert len(places) == told["fixture_map"]["places"]
    ratio = places["ratio_to_present"]
    assert ratio.max() == best["ratio_to_present"].item() == told["fixture_map"]["best"]["ratio"]
    assert ratio[0] == told["fixture_map"]["present"]["ratio"] == 1.0  # the index itself stands on the curve alone
    steps = pl.read_csv(folder / "fixtures_needed.csv")
    assert steps["robot_seen"].to_list() == [s["robot_seen"] for s in told["fixtures"]["steps"]]
    curves = pl.read_csv(folder / "index_curve.csv").filter("bend")
    assert curves["poses"].to_list() == [c["bend"] for c in told["curves"]]


@pytest.mark.slow
def test_predicted_deviation_is_that_of_simulated_fits(done):
    """Fit 4 000 noisy measurements by plain least squares: the spread is the predicted one."""
    b = done[1].basis
    rows = b.rows[b.chosen, 0]
    sigma = b.model.noise(b.pool.samples.take(b.chosen))
    noise = np.random.default_rng(0).normal(size=(4000, len(rows))) * sigma
    weight = 1 / sigma[:, None]
    fits = np.linalg.lstsq(rows * weight, (noise / sigma).T, rcond=None)[0]
    assert np.allclose(fits.std(axis=1), b.predicted.std, rtol=0.06)
    table = pl.read_csv(done[0] / "identifiability.csv").filter("seen")
    lengths = [p.unit == "m" for p in b.model.parameters]
    mdeg = np.rad2deg(b.predicted.std[~np.array(lengths)]) * 1e3
    assert np.allclose(table["std_mdeg"].drop_nulls().to_numpy(), mdeg, rtol=1e-5)


@pytest.mark.slow
def test_sensitivity_is_the_change_of_the_reading(done):
    """One prior sigma of each parameter, put into the model itself, changes the reading by what the table says."""
    b = done[1].basis
    table = {r["parameter"]: r for r in pl.read_csv(done[0] / "sensitivity.csv").to_dicts()}
    exact = b.whole.reading(b.pool.samples)
    for k, p in enumerate(b.whole.parameters):
        step = np.zeros(len(b.whole.names))
        step[k] = p.prior * 1e-3
        change = (b.whole.reading(b.pool.samples, step) - exact) / 1e-3 * 1e6
        assert table[p.name]["rms_um"] == pytest.approx(np.sqrt(np.mean(change**2)), rel=1e-2, abs=1e-3)
        assert table[p.name]["max_um"] == pytest.approx(np.abs(change).max(), rel=2e-2, abs=1e-3)
    assert list(table) == sorted(table, key=lambda n: -table[n]["rms_um"])


@pytest.mark.slow
def test_no_random_set_beats_a_curve_s_bound(done):
    b = done[1].basis
    rng = np.random.default_rng(1)
    for curve in b.curves:
        rows = b.rows[:, 0] * (b.model.prior if curve.scaled else 1.0)
        for n, value, bound in zip(curve.sizes, curve.values, curve.bounds, strict=True):
            tried = []
            for _ in range(20):
                mu = np.linalg.svd(rows[rng.choice(len(rows), n, replace=False)], compute_uv=False)
                of = {
                    "O1": np.exp(np.log(mu).mean()) / np.sqrt(n),
                    "O2": mu[0] / mu[-1],
                    "O3": mu[-1],
                    "O4": mu[-1] ** 2 / mu[0],
                    "O5": 1 / (1 / mu).sum(),
                }
                tried.append(of[curve.index])
            if curve.index == "O2":
                assert bound <= value <= min(tried)
            else:
                assert bound >= value >= max(tried)


@pytest.mark.slow
def test_progress_is_told(done):
    stages = list(dict.fromkeys(s for s, _, _ in done[2]))
    assert stages == ["candidates", "what is seen", "index curves", "fixture places", "fixtures", "pictures"]
    assert all(0 <= d <= max(of, d) for _, d, of in done[2])


@pytest.mark.slow
def test_a_file_in_the_way_is_told_and_an_unknown_index_too(done, tmp_path):
    with pytest.raises(InputError, match="O9"):
        study(load_cell("comau-nj130/edbb"), index="O9")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        StudyResult(done[1]).write(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
def test_text_is_short_and_names_what_matters(done):
    text = done[1].overview().text()
    for word in ("25 of 32", "best", "fixture", "d3"):
        assert word in text
    assert len(text.splitlines()) <= 20


@pytest.mark.slow
def test_the_units_of_an_index_are_said_wherever_it_is(done, told):
    """Of O2 most: it is 93, 263 or 14 590 by them."""
    assert "(in m, rad)" in done[1].overview().text()
    assert told["index_scaling"] == "m, rad"
    titles = [panel.title for panel in draw_curves(done[1]).panels]
    assert [t for t in titles if not t.endswith(("raw (m, rad)", "unit-free"))] == []
    assert len(titles) == 10
