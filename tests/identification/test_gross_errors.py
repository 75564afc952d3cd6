"""A calibration that is grossly wrong is refused: a scale, a unit, another robot, a link far beyond what links are.

The runs are those of the independent generator, whose arms err by 0.4 mm and 0.5 mrad a parameter.
"""

import re
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.cell.reading import load_cell
from planner.common.errors import NoSolutionError
from planner.common.summary import Aside
from planner.common.units import DEG, MM
from planner.fit.gross_errors import DeclaredGeometry, _solve, _weigh_factor
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_run
from tests.simulation.generator import runs
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.truth import draw_truth

BUILD = {"tracker": runs.tracker, "bar": runs.edbb_static, "balls": runs.balls}
POSES = 70
FAST = FitSettings(release=False)
ONE_FACTOR = "all lengths are off by one factor"


def made(gauge, arm, seed=3, off=MappingProxyType({})):
    """A run of an arm whose errors are drawn, and those in ``off`` added."""
    truth = draw_truth(Arm.from_toml(arm), seed)
    errors = dict(truth.errors)
    for name, value in off.items():
        errors[name] += value
    return BUILD[gauge](Arm.from_toml(arm), POSES, seed, replace(truth, errors=MappingProxyType(errors)))


def problems_of(run, folder, lengths=1.0, angles=None, **changed):
    """Identify a made run whose readings are multiplied; ``changed``: texts of the cell in place of others."""
    path, cell = run.write(folder)
    lines = path.read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    names = lines[head].split(",")
    scaled = [k for k, n in enumerate(names) if n in ("length_mm", "x_mm", "y_mm", "z_mm")]
    rows = [line.split(",") for line in lines[head + 1 :]]
    for row in rows:
        for k in scaled:
            row[k] = repr(float(row[k]) * lengths)
    joints = [names.index(f"q{k + 1}_deg") for k in range(6)]
    for row in rows if angles is not None else ():
        q = angles(np.array([float(row[k]) for k in joints]))
        for k, value in zip(joints, q, strict=True):
            row[k] = repr(float(value))
    path.write_text("\n".join([lines[head], *map(",".join, rows)]) + "\n")  # without the name of the robot
    text = cell.read_text()
    for old, new in changed.get("texts", ()):
        assert old in text
        text = text.replace(old, new)
    cell.write_text(text)
    return identify(load_run(path, 6), load_cell(str(cell), planning=False), settings=FAST).problems


def larger_plate(cell, factor):
    """What makes the plate of a cell larger: its places of balls, each as it stands and as it shall."""
    _, *balls = re.split(r"(?=\[\[balls\]\])", cell)
    for ball in balls:
        (said,) = re.findall(r"position_mm = \[(.*?)\]", ball, re.S)
        yield said, ", ".join(repr(factor * float(v)) for v in said.split(",") if v.strip())


@pytest.mark.parametrize(
    ("gauge", "arm", "factor"),
    [("tracker", "kuka-kr6-r700", 1.05), ("tracker", "ur10", 1.005), ("bar", "comau-nj130", 1.02),
     ("bar", "ur10", 0.98), ("balls", "abb-irb120", 1.01)],
)  # fmt: skip
def test_one_factor_on_all_lengths_is_no_calibration(tmp_path, gauge, arm, factor):
    run = made(gauge, arm)
    plate = tuple(larger_plate(run.cell_toml, factor)) if gauge == "balls" else ()
    (said, *_) = problems_of(run, tmp_path, 1.0 if plate else factor, texts=plate)
    assert said.startswith(ONE_FACTOR)
    stated = float(re.search(r"\(([\d.]+) %\)", said)[1])
    assert stated == pytest.approx(100 * abs(factor - 1), abs=0.3)  # the arm's own lengths have up to three such sigmas
    assert ("longer" if factor > 1 else "shorter") in said


@pytest.mark.parametrize(
    ("gauge", "arm"), [("tracker", "kuka-kr6-r700"), ("bar", "ur10"), ("balls", "abb-irb120"), ("bar", "comau-nj130")]
)
def test_clean_arms_are_calibrated(tmp_path, gauge, arm):
    assert problems_of(made(gauge, arm), tmp_path) == ()


@pytest.mark.slow
@pytest.mark.parametrize("gauge", ["tracker", pytest.param("bar", marks=pytest.mark.long)])
def test_another_robot_is_named(tmp_path, gauge):
    said = problems_of(made(gauge, "ur10"), tmp_path, texts=[('robot = "ur10"', 'robot = "ur5e"')])
    assert "perhaps the robot is ur10" in said[0]


def test_a_link_that_is_really_off_by_16_mm_is_beyond_what_links_are(tmp_path):
    (said,) = problems_of(made("tracker", "kuka-kr6-r700", off={"a2": 16 * MM}), tmp_path)
    assert re.match(r"no such robot is so far off: a2 \(.*\) by 1[56]\.\d mm", said)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "mm"), [("inches", 25.4), pytest.param("cm", 10.0, marks=pytest.mark.long)])
def test_another_unit_is_named(tmp_path, unit, mm):
    with pytest.raises(NoSolutionError, match=f"perhaps the readings are in {unit}, not in mm"):
        problems_of(made("tracker", "ur10"), tmp_path, 1 / mm)


@pytest.mark.long
def test_joints_in_another_order_are_named(tmp_path):
    (said, *_) = problems_of(made("tracker", "ur10"), tmp_path, angles=lambda q: q[[0, 1, 2, 4, 3, 5]])
    assert "the columns of joints 4 and 5 are exchanged" in said


@pytest.mark.slow
def test_a_zero_that_is_lost_is_found_where_the_cell_allows_it(tmp_path):
    run = made("tracker", "kuka-kr6-r700", off={"theta3": 3 * DEG})
    (said,) = problems_of(run, tmp_path)
    assert said.startswith("no such robot is so far off: theta3 (zero of joint 3) by 3.0")
    assert "mastering" in said
    allowed = [('robot = "kuka-kr6-r700"', 'robot = "kuka-kr6-r700"\nclass = "hobby"')]
    assert problems_of(run, tmp_path, texts=allowed) == ()


@pytest.mark.slow
def test_a_tool_that_is_known_to_some_mm_and_a_fixture_elsewhere_count_for_nothing(tmp_path):
    off = {"map_x": 6 * MM, "map_z": -5 * MM, "fixture_A_x": 15 * MM}
    assert problems_of(made("bar", "kuka-kr6-r700", off=off), tmp_path) == ()


LINKS = np.array([0.4, 0.025, 0.455, 0.025, 0.42, 0.08])  # [m] of an arm of the class of 10 kg
SIGMA, READ = 1.0 * MM, 0.05 * MM  # of a length as declared, and as a run tells each


def linear_arm(rng, factor, share):
    """What a run says of an arm whose links err by a share of what is declared, and of one factor on all of them."""
    R = np.column_stack([np.eye(len(LINKS)) * SIGMA, LINKS]) / READ
    R = np.vstack([R, np.zeros(R.shape[1])])
    y = R @ np.append(share * rng.standard_normal(len(LINKS)), factor) + rng.standard_normal(len(R))
    R = np.column_stack([R, y])
    weighed = _weigh_factor(np.vstack([R, np.zeros(R.shape[1])]), np.ones(len(LINKS), dtype=bool), 1e-5, 0.02)
    nothing = np.zeros(len(LINKS))
    return DeclaredGeometry((), nothing, nothing, *weighed)


def test_the_evidence_is_the_density_of_the_readings():
    rng = np.random.default_rng(0)
    R, sizes = np.triu(rng.standard_normal((6, 6))), rng.uniform(0.1, 3.0, (4, 5))
    mean, std, evidence = _solve(R, sizes)
    X, y = R[:, :-1], R[:, -1]
    there = [X @ np.diag(s**2) @ X.T + np.eye(6) for s in sizes]
    density = np.array([multivariate_normal(np.zeros(6), C).logpdf(y) for C in there])
    np.testing.assert_allclose(np.diff(evidence), np.diff(density), atol=1e-10)
    for s, C, m, v in zip(
        sizes, there, mean, std, strict=True
    ):  # conditioning the joint normal of unknowns and readings
        gain = np.diag(s**2) @ X.T @ np.linalg.inv(C)
        np.testing.assert_allclose(m, gain @ y, atol=1e-10)
        np.testing.assert_allclose(v**2, np.diag(np.diag(s**2) - gain @ X @ np.diag(s**2)), atol=1e-10)


@pytest.mark.slow
def test_a_factor_is_told_from_links_as_far_as_it_can_be():
    """Links of a third of the declared size, as measured arms have; 200 arms each."""
    found = {}
    for factor in (0.0, 3e-3, 5e-3, 1e-2):
        rng = np.random.default_rng(7)
        arms = [linear_arm(rng, factor, 0.3) for _ in range(200)]
        refused = np.array([a.has_factor for a in arms])
        found[factor] = refused.mean()
        if factor:  # what is not refused has a limit that holds the factor, wherever it is not ruled out
            held = np.array([a.factor_at_most >= factor for a in arms])
            assert np.mean(refused | held) >= {3e-3: 0.6, 5e-3: 0.97, 1e-2: 1.0}[factor]
        else:
            assert np.mean([a.factor_at_most > 0 for a in arms]) <= 0.02
            assert all(isinstance(note, Aside) for a in arms for note in a.factor_notes if a.factor_at_most == 0)
    assert found[0.0] <= 0.005
    assert found[5e-3] >= 0.85
    assert found[1e-2] == 1.0


def test_a_factor_in_doubt_is_said_and_one_that_is_ruled_out_is_not():
    rng = np.random.default_rng(1)
    arms = [linear_arm(rng, 2.5e-3, 0.3) for _ in range(60)]
    doubtful = [a for a in arms if a.factor_at_most > 0 and not a.has_factor]
    assert doubtful
    for arm in doubtful:
        (said,) = arm.factor_notes
        assert said.startswith("all lengths may be off by one factor of 0.")
        assert not isinstance(said, Aside)
    clear = next(a for a in arms if a.factor_at_most == 0)
    assert "of up to 0.3 % would not be seen" in clear.factor_notes[0] or "0.4 %" in clear.factor_notes[0]


def test_robots_drawn_have_the_factor_as_often_as_it_is_likely():
    nothing = np.zeros(0)
    doubtful = DeclaredGeometry((), nothing, nothing, nothing, 2e-3, 4e-4, 0.14)
    drawn = doubtful.draw_factors(1000)
    has = drawn[drawn != 0.0]
    assert len(has) == 140
    np.testing.assert_allclose([has.mean(), has.std()], [2e-3, 4e-4], rtol=0.02)
    assert np.quantile(np.abs(drawn), 0.95) == pytest.approx(doubtful.factor_at_most, rel=0.02)
    assert not DeclaredGeometry((), nothing, nothing, nothing).draw_factors(1000).any()
