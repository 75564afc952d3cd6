"""A camera on the flange and one that stands: reading, derivative, a run by OpenCV identified, what is refused."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.file import CellFile
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import InputError
from planner.common.schema import read_toml, validate
from planner.design.candidates.pool import draw_candidates
from planner.documents.baseline import Baseline, BaselineFile, baseline_text
from planner.documents.gauge_unit_errors import own_errors_text
from planner.effects.context import Context
from planner.fit.run_setup import drop_unreadable, number_samples
from planner.gauges.vision.board_camera import BoardCamera
from planner.identification.pipeline import FitSettings, identify
from planner.model.model import Model
from planner.runs.loader import join_runs, load_run
from planner.runs.writer import save_run
from tests.gauges.camera.scene import Scene, pose, run_text
from tests.identification.few_draws import few_draws

SHIPPED = load_cell("ur5e/camera").path.read_text()
STANDING = (
    SHIPPED.replace('camera = "flange"', 'camera = "stand"')
    .replace("position_mm = [450, 0, 10]", "position_mm = [900, 0, 500]\nrpy_deg = [0, -90, 0]")
    .replace("map_mm = [0, 45, 60]", "map_mm = [0, 0, 20]")
    .replace("cone_deg = { fixture = 50 }", "cone_deg = { map = 50 }")
)
QUICK = FitSettings(release=False)


def read(folder, text, planning=True):
    path = folder / "camera.toml"
    path.write_text(text)
    return cell_of(read_toml(path, CellFile), path, "camera", planning)


@pytest.fixture(scope="module", params=["flange", "stand"])
def cell(request, tmp_path_factory):
    return read(tmp_path_factory.mktemp("cell"), SHIPPED if request.param == "flange" else STANDING)


@pytest.fixture(scope="module")
def pool(cell):
    return draw_candidates(cell, 300, seed=1)


def scene_of(cell, seed):
    standing = cell.fixtures[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = standing.R_BX, standing.p_BX
    return Scene.drawn(seed, cell.gauge.on_flange, T, pose([0, 0, 0], cell.tool.p_FM))


def measured(cell, pool, folder, count=90, seed=0, **how):
    path = folder / f"run{seed}.csv"
    path.write_text(run_text(scene_of(cell, seed), pool.q[:count], seed=seed, **how))
    return load_run(path)


@pytest.mark.slow
def test_candidates_show_the_whole_board(cell, pool):
    scene = Scene(cell.gauge.on_flange)
    standing = cell.fixtures[0]
    scene.standing[:3, :3], scene.standing[:3, 3] = standing.R_BX, standing.p_BX
    scene.sitting[:3, 3] = cell.tool.p_FM
    for q in pool.q[:100]:
        assert np.isfinite(scene.corners(q)).all()
        T = scene.board_in_camera(q)
        distance = np.linalg.norm(T[:3, 3])
        assert 0.3 <= distance <= 0.7
        assert np.rad2deg(np.arccos(-T[:3, 2] @ T[:3, 3] / distance)) <= 50.001


@pytest.mark.slow
def test_most_states_that_are_drawn_look_at_each_other(pool):
    """Of uniform states one in 2000 does."""
    assert pool.funnel.collision > 0.1 * pool.funnel.sampled
    assert pool.funnel.cones > 0.9 * pool.funnel.workspace


@pytest.mark.slow
def test_its_jacobian_is_the_derivative_of_its_reading(cell, pool):
    model, at, step = Model.from_cell(cell), pool.samples.take(slice(40)), 1e-6
    rows = model.rows(at)
    for k in range(len(model.names)):
        errors = np.zeros(len(model.names))
        errors[k] = step
        slope = (model.reading(at, errors) - model.reading(at, -errors)) / (2 * step)
        np.testing.assert_allclose(rows[:, :, k], slope, atol=1e-7, err_msg=model.names[k])


@pytest.mark.slow
def test_six_numbers_know_what_all_pixels_know(cell, pool):
    """Information about the parameters from the pixels themselves, by differences, and from the six numbers."""
    model, at, step = Model.from_cell(cell), pool.samples.take(slice(8)), 1e-6
    gauge, few = cell.gauge, range(0, len(model.names), 3)

    def pixels(k, sign):
        errors = np.zeros(len(model.names))
        errors[k] = sign * step
        return model.full_reading(at, errors)

    J = np.stack([(pixels(k, 1) - pixels(k, -1)) / (2 * step) for k in few], axis=2) / gauge.noise_px
    Z = model.rows(at)[:, :, list(few)] / gauge.sigmas[0]
    np.testing.assert_allclose(
        np.einsum("nra,nrb->ab", Z, Z), np.einsum("nra,nrb->ab", J, J), rtol=1e-5, atol=1e-4 * np.abs(J).max() ** 2
    )


@pytest.mark.slow
def test_a_run_that_opencv_made_is_identified(cell, pool, tmp_path):
    run = drop_unreadable(cell, measured(cell, pool, tmp_path, 120))
    assert len(run) == 120
    found = identify(run, cell, settings=QUICK)
    geometry = {s.name: s for s in found.stages}["geometry"]
    # six numbers; the first three scatter by noise / √K each, and a little more where they are held out
    expected = cell.gauge.sigmas[0] * np.sqrt(3)
    assert expected * 0.8 < geometry.held_out.rms < expected * 1.4
    assert {s.name: s for s in found.stages}["frames"].held_out.rms > 20 * expected
    # other states, another scene of the same arm: the fitted robot says where its flange is to where it was
    said = own_errors_text(found)
    after = float(said.split(" px after")[0].split()[-1])
    assert 0.15 * np.sqrt(2) * 0.9 < after < 0.15 * np.sqrt(2) * 1.15


@pytest.mark.slow
def test_a_board_that_is_two_per_cent_smaller_than_said_is_told(tmp_path):
    """Printers scale to the page; the robot would be fitted as larger, and every image would agree."""
    cell = read(tmp_path, SHIPPED)
    run = measured(cell, draw_candidates(cell, 300, seed=1), tmp_path, 60)
    larger = re.sub(r"(square_mm|marker_mm) = ([\d.]+)", lambda m: f"{m[1]} = {1.02 * float(m[2])!r}", SHIPPED)
    (said, *_) = identify(run, read(tmp_path, larger, planning=False), settings=QUICK).problems
    factor = re.match(r"all lengths are off by one factor \(([\d.]+) %\)", said)
    assert float(factor[1]) == pytest.approx(2.0, abs=0.3)
    assert "longer" in said


@pytest.mark.slow
def test_the_zeros_of_joints_are_found_within_their_uncertainty(cell, pool, tmp_path):
    miss = []
    for seed in range(3):
        found = identify(measured(cell, pool, tmp_path, 120, seed), cell, settings=QUICK)
        scene = scene_of(cell, seed)
        by_name = {e.name: e for e in found.estimates}
        for joint in (2, 3, 4):  # their neighbours are parallel: nothing else turns about them, so they stand alone
            e = by_name[f"theta{joint}"]
            if e.identifiable and not e.absorbs:
                miss.append((e.value - e.nominal - scene.zeros[joint - 1]) / e.std)
    assert len(miss) >= 6
    assert np.abs(miss).max() < 4
    assert np.sqrt(np.mean(np.square(miss))) < 2


@pytest.mark.slow
def test_reprojection_is_that_of_the_corners_themselves(cell, pool, tmp_path):
    """What the six numbers and the rest of the pixels give together is the error of the pixels, to first order."""
    run = measured(cell, pool, tmp_path, 80)
    found = identify(run, cell, settings=QUICK)
    fit, gauge = found.fit, found.fit.setup.gauge
    left = gauge.reading_numbers(run.samples, run.readings) - fit.model.full_reading(run.samples, fit.errors)
    direct = np.sqrt(np.nanmean((left.reshape(80, -1, 2) ** 2).sum(axis=2)))
    stage = found.stages[-1]
    np.testing.assert_allclose(gauge.own_errors(fit.setup, run.samples, left, stage.residual), direct, rtol=1e-3)


@pytest.mark.slow
def test_the_plan_forecasts_what_the_fit_of_its_run_finds(cell, pool, tmp_path):
    """The covariance from the model at the planned poses is the fit's, noise as declared."""
    run = measured(cell, pool, tmp_path, 120)
    found = identify(run, cell, settings=QUICK)
    model = Model.from_cell(cell)
    there = [model.names.index(n) for n in found.fit.model.names]
    rows = model.rows(pool.samples.take(slice(120)))[:, :, there] / cell.gauge.sigmas[0]
    scaled = rows.reshape(-1, len(there)) * model.prior[there]
    planned = np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled + np.eye(len(there))))) * model.prior[there]
    robot = [k for k, n in enumerate(found.fit.model.names) if not n.startswith(("base", "map", "probe"))]
    std = np.sqrt(np.diag(found.covariance))
    assert np.median(std[robot] / planned[robot]) == pytest.approx(1.0, abs=0.35)


@pytest.mark.slow
def test_a_run_is_written_and_read_as_it_was(cell, pool, tmp_path):
    run = measured(cell, pool, tmp_path, 12)
    for ending in (".csv", ".parquet"):
        save_run(run, tmp_path / f"again{ending}")
        again = load_run(tmp_path / f"again{ending}")
        np.testing.assert_allclose(again.readings.pixels, run.readings.pixels, atol=1e-8)
        np.testing.assert_allclose(again.samples.q, run.samples.q, atol=1e-12)
        assert (again.samples.seen == run.samples.seen).all()
    both = join_runs([run, replace(again, name="b")])
    assert len(both) == 24


@pytest.mark.slow
def test_a_corner_at_another_place_is_cut_out_and_said(cell, pool, tmp_path):
    run = measured(cell, pool, tmp_path, 40)
    pixels = np.array(run.readings.pixels)
    pixels[3, 7] += [30.0, -20.0]
    pixels[9, 20] -= [0.0, 25.0]
    sifted = drop_unreadable(cell, replace(run, readings=replace(run.readings, pixels=pixels)))
    assert np.isnan(sifted.readings.pixels[3, 7]).all()
    assert np.isnan(sifted.readings.pixels[9, 20]).all()
    assert np.isnan(sifted.readings.pixels[..., 0]).sum() == np.isnan(pixels[..., 0]).sum() + 2
    assert any("2 corners lie where their own image cannot have them" in w for w in sifted.warnings)


@pytest.mark.slow
def test_an_image_at_another_pose_is_an_outlier(cell, pool, tmp_path):
    run = measured(cell, pool, tmp_path, 90)
    q = np.array(run.samples.q)
    q[17] += np.deg2rad([0, 0.4, 0, 0, -0.5, 0])
    found = identify(replace(run, samples=replace(run.samples, q=q)), cell, settings=QUICK)
    assert 17 in found.outliers


@pytest.mark.slow
def test_images_of_few_corners_are_cut_out(cell, pool, tmp_path):
    run = measured(cell, pool, tmp_path, 20)
    pixels = np.array(run.readings.pixels)
    pixels[4, 3:] = np.nan
    seen = ~np.isnan(pixels[..., 0])
    run = replace(run, readings=replace(run.readings, pixels=pixels), samples=replace(run.samples, seen=seen))
    sifted = drop_unreadable(cell, run)
    assert len(sifted) == 19
    assert any("1 of 20 images show fewer than 4 corners (the first: run0.csv, line" in w for w in sifted.warnings)


def changed(text, **columns):
    lines = text.splitlines()
    head = lines[1].split(",")
    rows = [dict(zip(head, line.split(","), strict=True)) for line in lines[2:]]
    for row in rows:
        row.update({k: f(row) for k, f in columns.items()})
    return "\n".join([*lines[:2], *(",".join(str(row[h]) for h in head) for row in rows)]) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"corner": lambda r: int(r["corner"]) + 5}, "has a corner 28, but the ChArUco board, 7 × 5 squares of 30 mm"),
        ({"corner": lambda r: 23 - int(r["corner"])}, None),  # a board upside down is the same board turned
        ({"corner": lambda r: (int(r["corner"]) * 7) % 24}, "half of the corners are .* px or more from where"),
        ({"u_px": lambda r: float(r["u_px"]) * 2}, "outside of an image of 1920 × 1200 px .*of another size"),
    ],
)
def test_another_board_or_size_is_refused(columns, said, pool, cell, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(changed(run_text(scene_of(cell, 0), pool.q[:30]), **columns))
    if said is None:
        drop_unreadable(cell, load_run(path))
        return
    with pytest.raises(InputError, match=said):
        drop_unreadable(cell, load_run(path))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,corner,u_px\n1,0,-60,60,0,0,0,3,100\n", "no column v_px"),
        ("pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,u_px,v_px\n1,0,-60,60,0,0,0,3,100\n", "there is no corner"),
        (
            "pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,corner,u_px,v_px\n"
            "1,0,-60,60,0,0,0,3,100,100\n1,0,-60,60,0,0,0,3,101,100\n",
            "line 3, column 'corner': corner 3 stands twice in one image",
        ),
        ("pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,corner,u_px,v_px\n1,0,-60,60,0,0,0,-3,100,5\n", "corner"),
    ],
)
def test_half_a_corner_is_refused(text, said, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_run(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("map_axis = [0, 0, 1]", "map_axis = [1, 0, 0]", "gauge.tool_rpy_deg.*make them agree"),
        ("length_mm = [300, 700]", "length_mm = [60, 700]", "nearer than the board is large"),
        ("noise_px = 0.15", "noise_px = 0.15\nnoise_um = 3", "'gauge.noise_um'.*gauge.noise_px"),
        ("noise_px = 0.15", "noise_px = 0.15\nnoise_mdeg = 3", "'gauge.noise_mdeg'.*gauge.noise_px"),
        ("square_mm = 30", "square_mm = 20", "square_mm, larger than marker_mm"),
        (
            "[gauge.place]\nposition_mm = [450, 0, 10]\nprior_mm = 20\nprior_deg = 2\n",
            "",
            r"\[gauge.place\].*where the board",
        ),
        ("cx_px", "cx", "cx_px"),
    ],
)
def test_a_cell_that_contradicts_itself_is_refused(old, new, said, tmp_path):
    assert old in SHIPPED
    with pytest.raises(InputError, match=said):
        read(tmp_path, SHIPPED.replace(old, new))


@pytest.fixture(scope="module")
def flange(tmp_path_factory):
    return read(tmp_path_factory.mktemp("flange"), SHIPPED)


@pytest.fixture(scope="module")
def flange_pool(flange):
    return draw_candidates(flange, 150, seed=1)


@pytest.mark.slow
def test_a_larger_board_shows_as_its_own_effect_says(flange, flange_pool):
    """The board's scale by differences of the model with another board, and that the released error knows of it."""
    model, at, step = Model.from_cell(flange), flange_pool.samples.take(slice(30)), 1e-6

    def reading(size):
        file = flange.gauge.board.file
        other = file.model_copy(update={"square_mm": file.square_mm * size, "marker_mm": file.marker_mm * size})
        return Model(replace(model.setup, gauge=replace(flange.gauge, board=other.board)), ()).full_reading(at)

    slope = (reading(1 + step) - reading(1 - step)) / (2 * step)
    (effect,) = flange.gauge.errors(None)
    rows = model.subset([]).plus(list(effect.make())).rows(at)[:, :, 0] / flange.gauge.number_scale
    np.testing.assert_allclose((rows**2).sum(axis=1), np.nansum(slope**2, axis=1), rtol=1e-4)


@pytest.mark.long
def test_what_is_stated_of_the_board_is_in_the_error_that_is_stated(flange, flange_pool, tmp_path):
    run = measured(flange, flange_pool, tmp_path, 100)
    coarse = read(tmp_path, SHIPPED.replace("[gauge.lens]", "scale_ppm = 1000\n\n[gauge.lens]"))
    fine = read(tmp_path, SHIPPED.replace("[gauge.lens]", "scale_ppm = 10\n\n[gauge.lens]"))
    with few_draws():
        stated = [identify(run, c).workspace_error for c in (coarse, fine)]
    assert stated[0] > 2 * stated[1]
    assert stated[0] > 1e-4


@pytest.mark.long
def test_a_later_check_is_planned_where_the_board_stands(flange, flange_pool, tmp_path):
    """What later images will show is expected where the cell has board and camera, not at the robot's base."""
    run = number_samples(measured(flange, flange_pool, tmp_path, 100))
    with few_draws():
        found = identify(run, flange)
    text = baseline_text(found.released, found.degrees_of_freedom, run, flange, "")
    known = Baseline.of(validate(json.loads(text), BaselineFile, "posterior.json"), flange, "posterior.json")
    at = flange_pool.samples.take(slice(100, 140))
    camera = known.model.setup.gauge
    assert isinstance(camera, BoardCamera)
    p_CB = camera.view(known.model.setup, at, Context(known.model.setup, at).motion)[1]
    distance = np.linalg.norm(p_CB, axis=1)
    assert (distance > 0.25).all()
    assert (distance < 0.75).all()
    assert (p_CB[:, 2] > 0.9 * distance).all()  # before the camera
    free = read(tmp_path, FREE)
    assert free.gauge.lasting_places(known.model.setup) is None


FREE = SHIPPED.replace("height_px = 1200", "height_px = 1200\nfree = true")


@pytest.mark.slow
def test_a_lens_is_found_with_the_arm(flange, flange_pool, tmp_path):
    """The true lens is 2 % longer, off centre and bent otherwise than the cell says where to begin."""
    free = read(tmp_path, FREE)
    scene = scene_of(flange, 4)
    scene.lens = np.array([[1428.0, 0, 971.0], [0, 1424.0, 590.0], [0, 0, 1]])
    scene.bent = np.array([-0.13, 0.08, 4e-4, -3e-4, 0.0])
    (tmp_path / "run.csv").write_text(run_text(scene, flange_pool.q[:120], seed=4))
    run = drop_unreadable(free, load_run(tmp_path / "run.csv"))
    stated = identify(drop_unreadable(flange, run), flange, settings=QUICK)
    found = identify(run, free, settings=QUICK)
    assert (
        found.stages[-1].held_out.rms < 1.4 * flange.gauge.sigmas[0] * np.sqrt(3) < stated.stages[-1].held_out.rms / 2
    )
    said = own_errors_text(found).split("the lens as found: ")[1]
    numbers = [float(w.strip(",")) for w in said.split() if w.strip(",").lstrip("-").replace(".", "").isdigit()]
    np.testing.assert_allclose(numbers[:2], [1428, 1424], rtol=1e-3)
    np.testing.assert_allclose(numbers[2:4], [971, 590], atol=2.0)
    np.testing.assert_allclose(numbers[4:6], [-0.13, 0.08], atol=0.02)


@pytest.mark.slow
def test_the_lens_has_its_columns(flange_pool, tmp_path):
    model, at, step = Model.from_cell(read(tmp_path, FREE)), flange_pool.samples.take(slice(20)), 1e-6
    rows = model.rows(at)
    assert rows.shape[1] == 14
    assert sum(n.startswith("lens_") for n in model.names) == 8
    for k in range(len(model.names)):
        errors = np.zeros(len(model.names))
        errors[k] = step
        slope = (model.reading(at, errors) - model.reading(at, -errors)) / (2 * step)
        np.testing.assert_allclose(rows[:, :, k], slope, atol=1e-7, err_msg=model.names[k])


@pytest.mark.slow
def test_columns_of_the_lens_are_those_of_the_pixels(flange_pool, tmp_path):
    """The information about lens and arm together is that of all pixels, the lens moved by OpenCV's own projection."""
    free = read(tmp_path, FREE)
    model, at, step = Model.from_cell(free), flange_pool.samples.take(slice(8)), 1e-6
    gauge = free.gauge

    def pixels(**moved):
        other = replace(gauge, lens=replace(gauge.lens, **moved))
        return Model(replace(model.setup, gauge=other), ()).full_reading(at)

    focal = (pixels(focal=gauge.lens.focal * [1 + step, 1]) - pixels(focal=gauge.lens.focal * [1 - step, 1])) / (
        2 * step
    )
    by_numbers = model.rows(at)[:, :, model.names.index("lens_fx")] / gauge.number_scale
    np.testing.assert_allclose((by_numbers**2).sum(axis=1), (focal**2).sum(axis=1), rtol=1e-5)


@pytest.mark.slow
def test_one_marker_cannot_show_a_lens(tmp_path):
    marker = FREE.replace('kind = "charuco"\ncolumns = 7\nrows = 5\nsquare_mm = 30', 'kind = "marker"')
    with pytest.raises(InputError, match="14 corners or more, and the marker of 22 mm has 4"):
        read(tmp_path, marker)
