"""What cannot be separated is said in one sentence, each with its exit code."""

import json

import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.design.discrimination.findings import read_identification
from planner.design.discrimination.selection import select_discriminating_poses
from tests.command import edbb
from tests.design.discrimination.worlds import NJ, cell, pool, usual


def file(folder, *findings, robot=NJ):
    """A small identification.json: (effect, on, value, unit, rivals) of every finding."""
    content = {
        "schema": "edbb-identification/1",
        "robot": robot,
        "n_samples": 200,
        "degrees_of_freedom": 160.0,
        "stages": [{"name": "last", "train": {"rms_mm": 0.008}, "held_out": {"rms_mm": 0.01}}],
        "parameters": [],
        "findings": [
            {"effect": e, "on": on, "value": v, "unit": u, "rivals": list(r), "p_value": 0.0}
            for e, on, v, u, r in findings
        ],
        "a key of later": 1,
    }
    path = folder / "identification.json"
    path.write_text(json.dumps(content))
    return path


LAG = ("gauge lag", "gauge", 0.004, "s")


def test_values_are_read_in_si_units(tmp_path):
    path = file(tmp_path, ("backlash", "joint 3", 0.01, "deg", ["hysteresis, joint 3"]))
    found = read_identification(path, NJ, 6)
    assert found.found[0].size == pytest.approx(1.7453e-4, rel=1e-4)
    assert found.noise(1) == pytest.approx(0.008e-3 * (200 / 160) ** 0.5)


@pytest.mark.parametrize(
    ("findings", "robot", "words"),
    [
        ((), NJ, "nothing to separate, it has no findings"),
        (((*LAG, []),), NJ, "nothing to separate, its findings have no rivals"),
        (((*LAG, ["servo lag, all joints"]),), "ur10", "identifies the robot 'ur10'"),
    ],
)
def test_a_file_that_asks_nothing_is_refused(findings, robot, words, tmp_path):
    path = file(tmp_path, *findings, robot=robot)
    with pytest.raises(InputError, match=words):
        read_identification(path, NJ, 6)


def test_the_command_refuses_before_it_plans(tmp_path):
    path = file(tmp_path, (*LAG, []))
    done = edbb("plan", f"{NJ}/edbb", "-o", tmp_path / "out", "--separate", path)
    assert done.returncode == 2
    assert "nothing to separate" in done.screen
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_exact_rivals_have_no_plan(tmp_path):
    """A clock that runs late, and joints that all run behind by as much, are one and the same."""
    found = read_identification(file(tmp_path, (*LAG, ["servo lag, all joints"])), NJ, 6)
    moving = "continuous"
    with pytest.raises(NoSolutionError, match=r"the same in every pose .* the controller itself") as refused:
        select_discriminating_poses(cell(moving), pool(moving), usual(moving), found, 0)
    assert refused.value.exit_code == 3


@pytest.mark.slow
def test_a_band_of_a_gear_has_no_poses(tmp_path):
    """What the posterior holds has no frequency of its own, and that is said."""
    band = ("gear ripple", "joint 3", 0.01, "deg", ["encoder once a turn, joint 3"])
    found = read_identification(file(tmp_path, band), NJ, 6)
    with pytest.raises(NoSolutionError, match="gear ripple, joint 3: the runs show a band of it, and no one frequency"):
        select_discriminating_poses(cell(), pool(), usual(), found, 0)


@pytest.mark.slow
def test_exact_rivals_beside_others_are_told(tmp_path):
    rivals = ["servo lag, all joints", "servo lag, joint 2", "thermal drift, joint 1"]
    found = read_identification(file(tmp_path, (*LAG, rivals)), NJ, 6)
    moving = "continuous"
    done = select_discriminating_poses(cell(moving), pool(moving), usual(moving), found, 0).separation
    assert [t.rival for t in done.told if t.named] == ["servo lag, joint 2"]
    assert len(done.inseparable) == 2
    assert any("thermal drift, joint 1" in s and "temperature_degC" in s for s in done.inseparable)
    first = done.told[0]
    assert first.before < first.noncentrality <= first.bound
    assert first.power > 0.99
    assert done.verified
    assert 0 <= done.gap < 0.3


@pytest.mark.slow
def test_what_would_help_is_found_by_trying(tmp_path):
    """One bar from one place sees no difference between an encoder and a bearing of the first axis; two places do."""
    wave = ("encoder once a turn", "joint 1", 0.02, "deg")
    found = read_identification(file(tmp_path, (*wave, ["axis wobble once a turn, joint 1"])), NJ, 6)
    with pytest.raises(NoSolutionError, match="a second fixture, say at") as refused:
        select_discriminating_poses(cell(), pool(), usual(), found, 0)
    assert "payload" not in str(refused.value)


def test_what_stepped_again_and_again_is_one_finding(tmp_path):
    """A reflector that was seated anew three times is asked for once, with all rivals of its steps."""
    steps = [
        ("step", "tool point", size, "mm", [rival])
        for size, rival in ((0.1, "soft base, base"), (-0.4, "backlash, joint 2"), (0.2, "soft base, base"))
    ]
    found = read_identification(file(tmp_path, *steps), NJ, 6).found
    assert [f.name for f in found] == ["step, tool point"]
    assert found[0].rivals == ("soft base, base", "backlash, joint 2")
    assert found[0].size == pytest.approx(-0.4e-3)
