"""Poses chosen and ordered as the EDBB paper does it: pruned by the condition number, shortest by the slowest axis."""

import json
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.session.as_published import follow_paper
from planner.session.options import PlanOptions
from planner.session.point_poses import BarPoses
from planner.workflow.plan_results import PlanResult
from planner.workflow.planning import plan
from tests.command import edbb
from tests.quick_search import quick_search
from tests.workflow.conftest import small_cell

FEW = (("candidates = 3000", "candidates = 250"), ("validate = 4", "validate = 2"))


@pytest.fixture(scope="module")
def pruned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pruned")
    path = small_cell("comau-nj130/paper", folder, *FEW)
    with quick_search():
        done = edbb("plan", path, "--as-published", "--poses", 30, "-o", folder / "out", "-v")
    assert done.returncode == 0, done.stderr
    return path, folder / "out", done.stdout + done.screen


def naive_condition(rows, n):
    """The condition number that is left when one row after the other goes, each time the least missed."""
    while len(rows) > n:
        without = rows.T @ rows - rows[:, :, None] * rows[:, None, :]
        value = np.linalg.eigvalsh(without)
        rows = np.delete(rows, np.argmin(value[:, -1] / value[:, 0]), axis=0)
    return np.linalg.cond(rows)


@pytest.mark.slow
def test_a_pruned_plan_says_its_value_the_exchange_s_and_the_bound(pruned):
    _, folder, said = pruned
    seen = json.loads((folder / "plan.json").read_text())["observability"]
    assert seen["method"] == "pruning"
    assert seen["on_grid"]["value"] == seen["O2"]  # no pose was moved afterwards
    assert seen["bound"] < seen["exchange"]["value"] < seen["O2"]
    assert seen["gap"] == pytest.approx(seen["O2"] / seen["bound"] - 1, abs=1e-6)
    assert seen["exchange"]["gap"] == pytest.approx(seen["exchange"]["value"] / seen["bound"] - 1, abs=1e-6)
    words = (
        f"pruning {seen['O2']:#.4g} (gap {100 * seen['gap']:.1f} %), exchange {seen['exchange']['value']:#.4g} (gap "
    )
    assert words in said
    assert f"bound {seen['bound']:#.4g}" in said
    assert "pruning, one pose at a time" in (folder / "report.html").read_text()


@pytest.mark.slow
def test_a_plan_as_published_says_so_and_has_g_code_and_krl(pruned):
    _, folder, _ = pruned
    made = json.loads((folder / "plan.json").read_text())
    assert any(note.startswith("planned as published: 250 candidates") for note in made["notes"])
    assert made["tour"]["cost_of_leg"] == "slowest axis at full speed"
    assert made["tour"]["optimal"]
    assert {p.suffix for p in folder.iterdir()} >= {".cnc", ".src"}
    cell = load_cell(str(folder / "cell.toml"))
    assert cell.file.plan.as_published
    assert cell.file.motion.order == "slowest-axis"


@pytest.mark.slow
def test_as_published_sets_every_stage():
    cell = load_cell("comau-nj130/edbb")
    same, asked, notes = follow_paper(cell, PlanOptions())
    assert (same, asked, notes) == (cell, PlanOptions(), ())
    changed, asked, notes = follow_paper(cell, PlanOptions(as_published=True))
    assert (asked.aim, asked.index, asked.method, asked.order) == ("index", "O2", "pruning", "slowest-axis")
    assert set(asked.dialect) >= {"bnr", "krl"}
    assert changed.plan.candidates == 3400
    assert "PRM" in notes[0]
    from_the_cell = follow_paper(changed, PlanOptions())
    assert from_the_cell[1] == replace(asked, as_published=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "options", "words"),
    [
        ("comau-nj130/edbb", {"aim": "tracing"}, "--aim asks for something else"),
        ("comau-nj130/edbb", {"order": "slowest-limit"}, "--order asks for something else"),
        ("comau-nj130/edbb", {"method": "exchange"}, "--method asks for something else"),
        ("comau-nj130/edbb", {"index": "O1"}, "--index asks for something else"),
        ("comau-nj130/edbb", {"until_mm": 0.1}, "--until-mm asks for something else"),
        ("kuka-kr6-r700/trical", {}, "plans for a bar or a wire, the gauge here is 'trical'"),
    ],
)
def test_what_does_not_go_with_the_paper_is_refused(cell, options, words):
    with pytest.raises(InputError, match=words):
        follow_paper(load_cell(cell), PlanOptions(as_published=True, **options))


@pytest.mark.slow
def test_the_poses_are_those_that_naive_pruning_leaves(pruned):
    path, folder, _ = pruned
    session = BarPoses(load_cell(str(path)), PlanOptions(poses=30, method="pruning"))
    session.draw(Stages())
    with quick_search():
        choice = session.select(Stages()).choice
    rows = choice.model.rows(session.pool.samples)[:, 0]
    seen = json.loads((folder / "plan.json").read_text())["observability"]
    assert naive_condition(rows, 30) == pytest.approx(seen["O2"], rel=1e-6)


@pytest.mark.long
def test_the_method_of_the_cell_is_that_of_the_command_line(pruned, tmp_path):
    path, folder, _ = pruned
    asked = tmp_path / "cell.toml"
    asked.write_text(path.read_text().replace("[plan]", '[plan]\nmethod = "pruning"'))
    made = plan(asked, poses=30)
    assert isinstance(made, PlanResult)
    told = json.loads((folder / "plan.json").read_text())
    assert made.plan.choice.pruning is not None
    assert made.plan.choice.raw_indices["O2"] == pytest.approx(told["observability"]["O2"])


@pytest.mark.slow
def test_without_a_number_pruned_poses_are_as_many_as_its_curve_bends_at(pruned):
    path, _, _ = pruned
    session = BarPoses(load_cell(str(path)), PlanOptions(method="pruning"))
    session.draw(Stages())
    with quick_search():
        choice = session.select(Stages()).choice
    assert not session.tracing
    assert len(choice.q) == choice.pruning.left.knee


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("", "slowest-limit"),
        ('order = "slowest-limit"', "slowest-limit"),
        ('order = "slowest-axis"', "slowest-axis"),
    ],
)
def test_the_order_is_read(line, order, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(load_cell("comau-nj130/edbb").path.read_text().replace("[motion]", f"[motion]\n{line}"))
    assert load_cell(str(path)).motion.order == order


@pytest.mark.long
def test_an_order_on_the_command_line_is_in_the_plan_and_in_its_cell(pruned, tmp_path):
    cell = load_cell("comau-nj130/edbb")
    asked = PlanOptions(order="slowest-axis").in_motion(cell)
    assert asked.motion.order == asked.file.motion.order == "slowest-axis"
    path, folder, _ = pruned
    again = edbb("plan", path, "--order", "slowest-limit", "--poses", 24, "-o", tmp_path / "out")
    assert again.returncode == 0, again.stderr
    made = json.loads((tmp_path / "out" / "plan.json").read_text())["tour"]
    assert made["cost_of_leg"] == "slowest of axes, tool speed and gauge rate"
    told = json.loads((folder / "plan.json").read_text())["tour"]
    assert told["cost_of_leg"] == "slowest axis at full speed"
    assert load_cell(str(tmp_path / "out" / "cell.toml")).motion.order == "slowest-limit"
