"""Sessions of one arm with fixtures, gauges and zeros of their own, identified as one.

The joint fit is held against a least squares written here (scipy, the generator's arm, its own derivatives): what both
predict of poses that neither saw.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from planner.common.errors import InputError
from planner.identification.pipeline import FitSettings
from planner.identification.pipeline import identify as fit_and_trace
from planner.model.identification_document import Identification
from planner.runs.run import Samples
from planner.service.job_folder import JobFolder
from planner.service.job_requests import IdentificationRequest
from planner.workflow.identification import identify
from planner.workflow.measured_runs import load_sessions, run_sources
from tests.command import edbb
from tests.identification.few_draws import few_draws
from tests.identification.joint_world import BAR_LEFT, BAR_RIGHT, PRIOR, WIRE, ZERO_SIGMA, World, walk
from tests.identification.worlds import arm_of

JUMP = float(np.radians(0.05))
OTHERS = {"bar": BAR_RIGHT, "wire": WIRE}


def geometry_names():
    """Errors of the arm that both fits free: those of its rows."""
    arm = arm_of("kuka-kr6-r700")
    return [n for n in arm.names if n.rstrip("0123456789") in ("a", "d", "alpha", "theta", "beta")]


def stacked_fit(sessions, joint):
    """Errors (P,) and root of their covariance (P, P) of all sessions in one least squares, and the names."""
    names = geometry_names()
    sizes = np.concatenate([np.full(len(names), 1e-3), *([PRIOR] * 3 + [ZERO_SIGMA] for _ in sessions)])

    def lengths(x, s, q):
        point = walk(q, dict(zip(names, x[: len(names)], strict=True)))
        off = x[len(names) + 4 * s : len(names) + 4 * s + 4]
        return np.linalg.norm(point - np.array(sessions[s].bench.fixture) - off[:3], axis=1) + off[3]

    def sigma(s):
        q, at = sessions[s].q, np.zeros(len(sizes))
        turned = [(lengths(at, s, q + 1e-6 * np.eye(6)[j]) - lengths(at, s, q)) / 1e-6 for j in range(6)]
        return np.sqrt(sessions[s].bench.noise ** 2 + joint**2 * np.sum(np.square(turned), axis=0))

    noise = [sigma(s) for s in range(len(sessions))]

    def residual(z):
        x = z * sizes
        parts = [(lengths(x, s, one.q) - one.length) / noise[s] for s, one in enumerate(sessions)]
        return np.concatenate([*parts, z])

    found = least_squares(residual, np.zeros(len(sizes)), method="lm", x_scale=1.0)
    root = np.linalg.inv(np.linalg.qr(found.jac)[1])
    return lambda s, q: (lengths(found.x * sizes, s, q), lengths, sizes, found.x, root)


def predicted(fit, name, q):
    """Lengths (n,) [m] that the planner's fit predicts at a fixture."""
    setup = fit.setup
    samples = Samples(q, np.full(len(q), setup.place_names.index(name)))
    return fit.model.reading(samples, fit.errors)[:, 0] + setup.zero


@pytest.mark.slow
@pytest.mark.parametrize("other", ["bar", "wire"])
def test_the_joint_fit_is_the_stacked_least_squares(tmp_path, other):
    world = World.drawn(5)
    first = world.measure(tmp_path / "first", BAR_LEFT, 5)
    second = world.measure(tmp_path / "second", OTHERS[other], 6)
    run, cell, kept_out = load_sessions(run_sources([first.run, second.run], None, None))
    assert kept_out is None
    assert run.samples.session_numbers.tolist() == [0] * len(first.q) + [1] * len(second.q)
    fit = fit_and_trace(run, cell, None, FitSettings(release=False)).fit
    assert [n for n in fit.model.names if n.startswith("zero")] == ["zero", "zero_2"]
    stacked = stacked_fit([first, second], world.joint)
    fresh = World.drawn(5)
    for s, bench in enumerate((BAR_LEFT, OTHERS[other])):
        q = fresh.measure(tmp_path / f"unseen{s}", bench, 77 + s).q
        theirs, lengths, sizes, x, root = stacked(s, q)
        slopes = np.stack([(lengths(sizes * (x + 1e-3 * e), s, q) - theirs) / 1e-3 for e in np.eye(len(sizes))], axis=1)
        std = np.linalg.norm(slopes @ root, axis=1)
        apart = np.abs(predicted(fit, bench.name, q) - theirs) / std
        assert np.sqrt((apart**2).mean()) < 0.5  # of a standard deviation: noise is estimated there, and known here


@pytest.mark.slow
@pytest.mark.parametrize("other", ["bar", pytest.param("wire", marks=pytest.mark.long)])
def test_a_joint_that_jumps_between_two_sessions_is_named(tmp_path, other):
    world = World.drawn(1)
    runs = [
        world.measure(tmp_path / "first", BAR_LEFT, 1).run,
        world.measure(tmp_path / "next", OTHERS[other], 101, {"theta3": JUMP}).run,
    ]
    found = identify(runs, release=False)
    between = [f for f in found.findings if f.between_sessions]
    assert [(f.effect, f.on) for f in between] == [("step", "joint 3")]
    assert between[0].value == pytest.approx(JUMP, abs=4 * between[0].std)
    assert between[0].between_sessions == ("first/run.csv", "next/run.csv")
    assert between[0].note.startswith("between first/run.csv and next/run.csv the zero of joint 3 stood")
    assert len(found.findings) == 1


@pytest.mark.long
@pytest.mark.parametrize("other", ["bar", "wire"])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_nothing_is_named_where_nothing_jumped(tmp_path, other, seed):
    world = World.drawn(seed)
    runs = [
        world.measure(tmp_path / "first", BAR_LEFT, seed).run,
        world.measure(tmp_path / "next", OTHERS[other], seed + 100).run,
    ]
    found = identify(runs)  # with all draws: of few the posterior says too little to be held against the truth
    assert [f.name for f in found.findings] == []


@pytest.mark.slow
def test_a_fixture_of_one_name_is_another_place_in_each_session(tmp_path):
    world = World.drawn(2)
    moved = BAR_LEFT.__class__(**{**vars(BAR_LEFT), "off": (-2e-3, 1e-3, 0.0), "zero": 0.0})
    runs = [world.measure(tmp_path / d, b, k).run for k, (d, b) in enumerate([("one", BAR_LEFT), ("two", moved)])]
    run, cell, _ = load_sessions(run_sources(runs, None, None))
    assert run.places == ("one/A", "two/A")
    fit = fit_and_trace(run, cell, None, FitSettings(release=False)).fit
    shift = [fit.at([f"fixture_{d}/A_{a}" for a in "xyz"]) for d in ("one", "two")]
    np.testing.assert_allclose(shift[1] - shift[0], np.subtract(moved.off, BAR_LEFT.off), atol=5e-5)


@pytest.mark.slow
def test_what_does_not_belong_together_is_refused_in_one_sentence(tmp_path):
    world = World.drawn(3)
    one = world.measure(tmp_path / "one", BAR_LEFT, 3)
    two = world.measure(tmp_path / "two", BAR_RIGHT, 4)

    def refused(match, *, cell=None, plan=None):
        with pytest.raises(InputError, match=match) as told:
            identify([one.run, two.run], cell=cell, plan=plan)
        assert "\n" not in str(told.value)

    refused(rf"fixture 'B' is not in {re.escape(str(one.cell))}", cell=[one.cell, one.cell])
    refused("--cell is given 3 times for 2 runs", cell=[one.cell] * 3)
    two.cell.write_text(two.cell.read_text().replace("kuka-kr6-r700", "ur10").replace("90, 0, 45", "-90, 0, 45"))
    refused(rf"was measured on 'kuka-kr6-r700', but {re.escape(str(two.cell))} has the robot 'ur10'")
    text = two.run.read_text()
    two.run.write_text(text.replace("kuka-kr6-r700", "ur10"))
    refused(rf"has the robot 'ur10', but {re.escape(str(one.cell))} has 'kuka-kr6-r700'")
    two.cell.unlink()
    refused("no cell.toml lies beside it")
    with pytest.raises(InputError, match="given twice"):
        identify([one.run, Path(one.run)], cell=[one.cell, one.cell])


@pytest.mark.long
def test_the_command_line_takes_cells_in_pairs_and_writes_its_folder(tmp_path):
    world = World.drawn(6)
    one = world.measure(tmp_path / "one", BAR_LEFT, 3)
    two = world.measure(tmp_path / "two", WIRE, 4)
    words = [one.run, two.run, "--cell", one.cell, "--cell", two.cell, "--no-trace", "-o", tmp_path / "both"]
    with few_draws():
        done = edbb("identify", *words)
    assert done.returncode == 0, done.stderr
    said = Identification.read(tmp_path / "both" / "identification.json")
    assert [f.name for f in said.frames.fixtures] == ["A", "W"]
    assert (tmp_path / "both" / "report.html").is_file()
    assert not (tmp_path / "both" / "posterior.json").exists()
    assert (tmp_path / "both" / "expected_error.json").is_file()


def test_a_service_gives_each_run_its_plan_and_cell(tmp_path):
    folder = JobFolder.__new__(JobFolder)
    folder.file = lambda file: file.name
    folder.results = lambda job, kind, name, also="", only=(): name
    asked = IdentificationRequest(
        runs=[{"id": "0" * 64, "name": n} for n in ("first.csv", "next.csv")], plan="1" * 24, plans=["2" * 24]
    )
    assert asked.arguments(folder) == [
        "first.csv", "next.csv", "--plan", "plan/plan.json", "--plan", "plan-2/plan.json",
        "--cell", "plan/cell.toml", "--cell", "plan-2/cell.toml",
    ]  # fmt: skip
