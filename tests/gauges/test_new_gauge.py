"""A gauge is one file: one that the project does not ship plans, simulates and identifies like those that it does."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from planner.cell.file import CellFile
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import gauge_kinds, register_gauge
from planner.cell.reading import cell_of, load_cell
from planner.cell.workspace import Workspace
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.common.schema import read_toml
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import select_poses
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.identification.pipeline import identify
from planner.model.model import Model
from planner.motion.path.margins import WorkspaceBounds
from planner.report.plan_charts import bar_chart
from planner.report.plan_data import sample_drive
from planner.report.plan_report import report_plan
from planner.runs.run import Samples
from planner.session.options import PlanOptions
from planner.session.point_poses import PointPoses
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_truth
from planner.workflow.planning import plan_cell
from tests.gauges.plane_dial import PlaneDial

SHIPPED = load_cell("comau-nj130/edbb").path.read_text()
GAUGE = """[gauge]
kind = "plane-dial"
length_mm = [5, 25]
cone_deg = { fixture = 180, map = 40 }
plane_point_mm = [1300, 0, 600]

"""
POSES = 120


def cell_text(gauge=GAUGE):
    """The shipped cell with the dial instead of the bar: a level plane above the floor, the tool hanging down."""
    start, end = SHIPPED.index("[gauge]"), SHIPPED.index("[[obstacles]]")
    text = SHIPPED[:start] + gauge + SHIPPED[end:]
    lines = [line for line in text.splitlines() if not line.startswith("tool_about_bar_deg")]
    return "\n".join(lines).replace('measure = "continuous"', 'measure = "static"')


def read(folder, text):
    path = Path(folder) / "dial.toml"
    path.write_text(text)
    return cell_of(read_toml(path, CellFile), path, "dial")


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return read(tmp_path_factory.mktemp("cell"), cell_text())


@pytest.fixture(scope="module")
def pool(cell):
    return draw_candidates(cell, 4000, seed=1)


@pytest.mark.slow
def test_its_own_keys_are_read_and_written(cell, tmp_path):
    assert isinstance(cell.gauge, PlaneDial)
    np.testing.assert_allclose(cell.gauge.point, [1.3, 0, 0.6])
    assert cell.file.model_dump(mode="json", by_alias=True)["gauge"]["plane_point_mm"] == [1300, 0, 600]
    with pytest.raises(InputError, match="plane_point_mm"):
        read(tmp_path, cell_text(GAUGE.replace("plane_point_mm = [1300, 0, 600]\n", "")))
    with pytest.raises(InputError, match="plane_normals"):
        read(tmp_path, cell_text(GAUGE + "plane_normals = [0, 0, 1]\n"))


@pytest.mark.slow
def test_candidates_lie_where_it_reads(cell, pool):
    d = cell.map_position(pool.q)[:, 2] - 0.6
    assert len(pool) == 4000
    assert (d > 5e-3).all()
    assert (d < 25e-3).all()
    assert (cell.map_axis(pool.q)[:, 2] < -np.cos(np.deg2rad(40))).all()


@pytest.mark.slow
def test_its_plan_speaks_of_no_other_gauge(cell):
    poses = PointPoses(replace(cell, plan=replace(cell.plan, candidates=200)), PlanOptions())
    poses.draw(Stages())
    assert not re.search("tracker|reflector|beam|bar", poses.pool.funnel.text())


@register_gauge
@dataclass(frozen=True)
class SteepDial(PlaneDial):
    """A dial that reads however the tool leans: it has no cone."""

    kind: ClassVar[str] = "steep-dial"

    @property
    def margin_columns(self):
        return super().margin_columns[:2]

    def margins(self, stage, place, p_BM, axis_B):
        return super().margins(stage, place, p_BM, axis_B) if stage == "workspace" else np.empty((len(p_BM), 0))

    def margin_changes(self, travel):
        return super().margin_changes(travel)[:2]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plane-dial", "steep-dial"])
def test_its_plan_is_written_whatever_cones_it_has(kind, tmp_path):
    cell = read(tmp_path, cell_text(GAUGE.replace("plane-dial", kind)))
    made = plan_cell(replace(cell, plan=replace(cell.plan, candidates=600)), PlanOptions(poses=40), Stages())
    way = sample_drive(made.cell, made.drives[0])
    assert way.tilt is None
    length = bar_chart(made.cell, way, made.drives[0]).panels
    assert [p.title for p in length] == ["Length of the gauge"]
    report_plan(made).write(tmp_path)
    assert "Tilt of the" not in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_its_kind_is_taken(cell):
    with pytest.raises(ValueError, match=r"'plane-dial': tests\.gauges\.plane_dial has registered it already"):
        register_gauge(PlaneDial)


@pytest.mark.slow
def test_a_class_that_lacks_a_method_is_refused_by_its_name():
    half = type("Half", (Gauge, GaugeUnknowns), {"kind": "half-dial"})
    with pytest.raises(ValueError, match=r"'half-dial' \(.*lacks .*lag_moves.*parameters.*docstrings"):
        register_gauge(half)
    assert "half-dial" not in gauge_kinds()


@pytest.mark.slow
def test_its_margins_change_no_faster_than_it_says(cell, pool):
    rng, workspace = np.random.default_rng(0), Workspace(cell)
    bounds = WorkspaceBounds(workspace)
    dq = rng.normal(0.0, 1e-2, pool.q.shape)
    change = np.abs(workspace.margins(pool.q + dq) - workspace.margins(pool.q))
    _, far = bounds.travel(pool.q, dq[:, None])
    assert (change <= bounds.changes(dq[:, None], far) + 1e-12).all()


@pytest.mark.slow
def test_its_jacobian_is_the_derivative_of_its_reading(cell, pool):
    model, at = Model.from_cell(cell), pool.samples.take(slice(50))
    rows, step = model.rows(at)[:, 0], 1e-6
    for k in range(len(model.names)):
        errors = np.zeros(len(model.names))
        errors[k] = step
        slope = (model.reading(at, errors) - model.reading(at, -errors))[:, 0] / (2 * step)
        np.testing.assert_allclose(rows[:, k], slope, atol=1e-7)


@pytest.mark.long
def test_poses_are_selected_and_a_simulated_run_is_identified(cell, pool):
    choice, curve = select_poses(cell, pool, POSES, "O1", seed=1)
    with curve:
        _ = curve.result()
    assert len(choice.q) == POSES
    assert choice.certificate.verified
    poses = Samples(choice.q, np.zeros(POSES, dtype=int), t=np.arange(POSES) * 5.0, pose=np.arange(POSES))
    run = simulate_run(cell, "0" * 12, poses, draw_truth(cell, 3), seed=4)
    assert run.readings.columns == "length_mm"
    found = identify(run, cell)
    nominal, fitted = found.stages[0].held_out.rms, found.stages[-1].held_out.rms
    expected = float(np.median(Model.from_cell(cell).noise(choice.samples)))
    assert nominal > 20 * fitted
    assert fitted < 2 * expected
