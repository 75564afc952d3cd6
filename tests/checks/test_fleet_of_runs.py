"""Fleets drawn with known sizes: what is learnt of these, what two robots change and twenty, and who does not fit."""

import shutil
from types import SimpleNamespace as Of

import numpy as np
import pytest

from planner.cell.fleet_file import FleetFile, read_fleet, with_fleet
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.schema import read_toml
from planner.design.free_parameters import undeclared_errors
from planner.identification.fleet_fit import RobotErrors, misfits_of
from planner.runs.run import Samples
from planner.session.movable_cell import cell_files
from planner.workflow.fleet import Fleet, FleetResult, fleet, read_robots
from planner.workflow.identification import identify
from tests.command import edbb
from tests.identification.few_draws import few_draws
from tests.identification.joint_world import BAR_LEFT, World

KIND = "kuka-kr6-r700"
GROUPS = tuple(f"{what}, joint {j}" for what in ("lengths", "angles") for j in range(1, 7))
OF_A_GROUP = 2  # errors of a joint's lengths, or angles


def drawn_robot(rng, sizes, std, name="robot"):
    """A robot with errors of known sizes (G,), estimated with standard deviations about ``std``, all over the usual."""
    groups = tuple(g for g in GROUPS for _ in range(OF_A_GROUP))
    own = np.repeat(sizes, OF_A_GROUP)
    spread = std * rng.uniform(0.5, 2.0, len(groups))
    return RobotErrors(
        name, groups, own * rng.standard_normal(len(groups)) + spread * rng.standard_normal(len(own)), spread
    )


def test_compliances_that_a_cell_declares_count_joint_by_joint():
    """Such a fit has one family for all joints, and an estimate of each."""
    known = Of(name="compliance2", group="joint compliance", identifiable=True, value=5e-6, nominal=0.0, std=1e-7)
    unseen = Of(name="compliance1", group="joint compliance", identifiable=False, value=0.0, nominal=0.0, std=1e-5)
    release = Of(families=[Of(name="joint compliance", probability=1.0, factor=6.4)])
    robot = Of(n_joints=6, transforms=(), priors=Of(compliance=2e-6))
    found = RobotErrors.of("robot", Of(estimates=[known, unseen], release=release), robot)
    assert found.groups == ("compliance, joint 2",)
    assert found.value == pytest.approx([2.5])
    assert found.std == pytest.approx([0.05])


def drawn_fleet(seed, robots, std=0.2):
    """Sizes (G,), and a fleet with these."""
    rng = np.random.default_rng([seed, 9])
    sizes = np.exp(rng.normal(0.0, 0.35, len(GROUPS)))  # as well as usual sizes are known
    return sizes, Fleet.of(KIND, [drawn_robot(rng, sizes, std, f"r{k}") for k in range(robots)])


@pytest.mark.parametrize("robots", [2, 5, 20])
def test_intervals_hold_the_true_sizes(robots):
    inside, off = [], []
    for seed in range(60):
        sizes, made = drawn_fleet(seed, robots)
        order = [made.groups.index(g) for g in GROUPS]
        error = np.log(made.sizes.factors[order] / sizes)
        inside.append(np.abs(error) < 1.645 * made.sizes.log_std[order])  # 90 %
        off.append(error)
    assert 0.84 < np.mean(inside) < 0.97
    assert abs(np.mean(off)) < 0.12


def test_two_robots_change_little_and_twenty_much():
    sizes = np.full(len(GROUPS), 0.25)
    rng = np.random.default_rng(3)
    robots = [drawn_robot(rng, sizes, 0.02) for _ in range(20)]
    two, twenty = (np.median(Fleet.of(KIND, robots[:n]).sizes.factors) for n in (2, 20))
    assert 0.6 < two < 0.85
    assert 0.25 < twenty < 0.4


def test_what_readings_do_not_show_does_not_count():
    rng = np.random.default_rng(4)
    blind = [drawn_robot(rng, np.ones(len(GROUPS)), 30.0) for _ in range(20)]
    sizes = Fleet.of(KIND, blind).sizes
    assert np.all(np.abs(np.log(sizes.factors)) < 0.5)
    assert sizes.seen.max() < 1.0


@pytest.mark.slow
def test_a_robot_that_does_not_fit_is_named_and_no_other():
    named, wrong = 0, 0
    for seed in range(20):
        sizes, made = drawn_fleet(seed, 12)
        wrong += len(made.misfits())
        odd = list(made.robots)
        value = odd[3].value.copy()
        value[[g == "angles, joint 3" for g in odd[3].groups]] = 12.0 * sizes[GROUPS.index("angles, joint 3")]
        odd[3] = RobotErrors("odd", odd[3].groups, value, odd[3].std)
        found = Fleet.of(KIND, odd).misfits()
        named += [(m.name, m.group) for m in found] == [("odd", "angles, joint 3")]
    assert named >= 18
    assert wrong <= 1
    said = " ".join(value for _, value in FleetResult(Fleet.of(KIND, odd)).overview().facts)
    assert "odd does not fit the fleet: angles, joint 3 are " in said
    assert "the sizes count odd too; if it was damaged" in said
    assert "does not fit" not in str(FleetResult(made).overview().facts)


@pytest.mark.slow
def test_a_plan_takes_a_fleet_for_its_prior(tmp_path):
    _, made = drawn_fleet(1, 6)
    file = made.file()
    path = tmp_path / "fleet.toml"
    FleetResult(made).write(path)
    assert read_toml(path, FleetFile) == file
    cell = load_cell("kuka-kr6-r700/edbb")
    q = np.random.default_rng(0).uniform(-1, 1, (20, 6)) + cell.home
    usual, fleets = (undeclared_errors(c, Samples(q, np.zeros(20, int))) for c in (cell, with_fleet(cell, path)))
    size = {s.group: s.factor for s in file.sizes}
    for name, group in (("a2", "lengths, joint 3"), ("alpha3", "angles, joint 4"), ("theta4", "angles, joint 4")):
        k = usual.model.names.index(name)
        assert fleets.prior[k] == pytest.approx(size[group] * usual.prior[k])
    with pytest.raises(InputError, match="is of the robot 'kuka-kr6-r700', but the cell's is 'ur10'"):
        read_fleet(path, "ur10")
    own = tmp_path / "cell.toml"
    own.write_text(cell.path.read_text() + '\n[prior]\nfleet = "fleet.toml"\n')
    stated = load_cell(str(own))
    assert stated.robot.priors == with_fleet(cell, path).robot.priors
    for name, data in cell_files(stated).items():
        (tmp_path / "plan" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "plan" / name).write_bytes(data)
    assert load_cell(str(tmp_path / "plan" / "cell.toml")).robot.priors == stated.robot.priors
    assert "[prior]" not in cell_files(cell)["cell.toml"].decode()
    path.unlink()
    with pytest.raises(InputError, match=r"fleet\.toml"):
        load_cell(str(own))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Folders of identifications of three arms of a kind."""
    folder = tmp_path_factory.mktemp("fleet")
    for k in (1, 2, 3):
        made = World.drawn(k).measure(folder / f"arm{k}", BAR_LEFT, k)
        with few_draws():
            identify(made.run, cell=made.cell).write(folder / f"calibrated{k}")
    return folder


@pytest.mark.long
def test_identifications_are_a_fleet_and_the_next_robot_takes_it(calibrated):
    file = calibrated / "fleet.toml"
    done = edbb("fleet", calibrated / "calibrated1", calibrated / "calibrated2", "-o", file)
    assert done.returncode == 0, done.stderr
    said = read_toml(file, FleetFile)
    assert (said.robot, said.robots) == (KIND, 2)
    groups = {s.group: s for s in said.sizes}
    assert groups["lengths, joint 2"].seen > 1.0
    assert groups["angles, joint 3"].seen > 2.0
    words = ["identify", calibrated / "arm3" / "run.csv", "--cell", calibrated / "arm3" / "cell.toml"]
    with few_draws():
        done = edbb(*words, "--fleet", file, "-o", calibrated / "with_fleet")
    assert done.returncode == 0, done.stderr
    assert f"--fleet {file}" not in done.screen


@pytest.mark.long
def test_what_is_no_fleet_is_refused_in_one_sentence(calibrated, tmp_path):
    def refused(match, *paths):
        with pytest.raises(InputError, match=match) as told:
            fleet(paths)
        assert "\n" not in str(told.value)

    refused("one robot is no fleet", calibrated / "calibrated1")
    refused("given twice", calibrated / "calibrated1", calibrated / "calibrated1")
    shutil.copytree(calibrated / "calibrated1", tmp_path / "copy")
    refused(
        "holds the same calibration as .*calibrated1, number for number", calibrated / "calibrated1", tmp_path / "copy"
    )
    refused("neither a record nor a folder", calibrated / "calibrated1", tmp_path)
    other = tmp_path / "ur10"
    other.mkdir()
    for name in ("identification.json", "robot.toml"):
        text = (calibrated / "calibrated1" / name).read_text()
        (other / name).write_text(text.replace('"kuka-kr6-r700"', '"ur10"'))
    refused("a fleet is of one kind", calibrated / "calibrated1", other)


@pytest.mark.long
def test_a_record_counts_by_its_last_calibration(calibrated, tmp_path):
    record = tmp_path / "record"
    assert edbb("record", record, "--serial", "KR-1", "--add", calibrated / "calibrated1").returncode == 0
    found = read_robots([record, calibrated / "calibrated2"])
    assert [r.name for r in found.robots] == ["KR-1", "calibrated2"]
    alone = read_robots([calibrated / "calibrated1", calibrated / "calibrated2"])
    np.testing.assert_array_equal(found.robots[0].value, alone.robots[0].value)


def test_copies_of_one_calibration_are_known_by_their_numbers():
    one, same, other = (drawn_robot(np.random.default_rng(k), np.ones(len(GROUPS)), 0.1) for k in (1, 1, 2))
    assert one.is_copy_of(same)
    assert not one.is_copy_of(other)


def test_a_robot_of_three_times_the_errors_does_not_fit():
    rng = np.random.default_rng(7)
    file = Fleet.of(KIND, [drawn_robot(rng, np.ones(len(GROUPS)), 0.1) for _ in range(15)]).file()
    assert not list(misfits_of(drawn_robot(rng, np.ones(len(GROUPS)), 0.1), file))
    assert list(misfits_of(drawn_robot(rng, np.full(len(GROUPS), 8.0), 0.1), file))
