"""The estimate at the cell: how true it is over arms drawn, what it costs a pose, what it passes and where it stops."""

import json
import re
import time
from contextlib import nullcontext
from copy import copy
from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.centring.live_session import MeasuringSession
from planner.cli import cell_commands
from planner.design.learnt_sizes import ALWAYS, AT_TIMES, HARDLY_EVER, MOSTLY, Families, LearntErrors, learn_errors
from planner.next_session.live_advice import FEWEST_READ, LiveAdvice
from planner.next_session.live_estimate import LiveEstimate, PoseReading
from planner.runs.run import Mounting
from tests.centring.test_live_gauge import Gauge
from tests.command import edbb
from tests.identification.joint_world import BAR_LEFT, World
from tests.next_session.named_errors import named_errors_alone
from tests.simulation.made import wide_plan

POSES = 70


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A cell, and poses in its shell from the generator."""
    folder = tmp_path_factory.mktemp("bench")
    world = World.drawn(8)
    made = world.measure(folder / "run", BAR_LEFT.__class__(**{**vars(BAR_LEFT), "poses": POSES}), 8)
    return Of(cell=load_cell(str(made.cell), planning=False), made=made)


def is_validation(pose):
    """Tell whether a pose (from 0) only validates, where some do."""
    return (pose + 1) % 7 == 0


def begun(bench, until=None, some_validate=False):
    """An estimate before any reading, of named errors where some poses validate; what it knows before is made once."""
    if not hasattr(bench, "begun"):
        bench.begun = {}
    if some_validate not in bench.begun:
        q = bench.made.q[[not (some_validate and is_validation(k)) for k in range(len(bench.made.q))]]
        with named_errors_alone() if some_validate else nullcontext():
            bench.begun[some_validate] = LiveEstimate.of(bench.cell, q, np.zeros(len(q), dtype=int))
    one = bench.begun[some_validate]
    start = LearntErrors.usual(len(one.posterior.root), len(one.posterior.families))
    new = copy(one)
    new.posterior = replace(one.posterior, learnt=start)
    new.read, new.readings, new.history, new.off, new.until = [], [], [], [], until
    return new


def read_at(lengths):
    return {k: PoseReading.of_length(length) for k, length in enumerate(lengths)}


@pytest.mark.slow
def test_an_update_does_not_depend_on_the_order(bench):
    one, other, read = begun(bench, 0.02e-3), begun(bench), read_at(bench.made.length)
    one.add_all({k: read[k] for k in range(len(read) - 3)})
    for k in range(len(read) - 3, len(read)):
        stands = one.add(k, read[k])
    last = other.add_all({int(k): read[int(k)] for k in np.random.default_rng(0).permutation(len(read))})
    assert last.error == pytest.approx(stands.error, rel=2e-3)  # steps end at a hundredth of a reading's noise
    assert last.at_most == pytest.approx(stands.at_most, rel=2e-3)
    few = begun(bench).add_all({k: read[k] for k in range(5)})
    assert stands.error < 0.3 * few.error


def draw_arm(live, seed, acting=1.0):
    """Errors of an arm and its readings; so many of its rare families act, every other arm has one without a name."""
    rng = np.random.default_rng([seed, 4])
    families = live.posterior.families
    size = np.where(families.known, 1.0, 2.0 ** rng.uniform(-1, 1, len(families)))
    unnamed = np.flatnonzero(families.acts == HARDLY_EVER)
    size[np.setdiff1d(unnamed, rng.choice(unnamed, seed % 2))] = 0.0
    truth = size[families.number] * rng.standard_normal(len(families.number))
    if acting < 1.0:
        truth *= np.where(np.isin(families.acts, (MOSTLY, AT_TIMES)), rng.random(len(families)) < acting, 1.0)[
            families.number
        ]
    model = live.unknown.model
    read = model.reading(live.samples, live.mean + live.unknown.root @ truth)[:, 0]
    return truth, read + model.noise(live.samples) * rng.standard_normal(len(live.samples))


@pytest.mark.long
def test_what_is_expected_is_what_comes(bench):
    """Arms drawn with sizes between half and twice the usual: mean square and 95 % limit of what is left."""
    ratio, below = [], []
    for seed in range(60):
        live = begun(bench)
        truth, readings = draw_arm(live, seed)
        stands = live.add_all(read_at(readings[:45]))
        off = truth - live.posterior.learnt.mean
        square = off @ live.unknown.weight_per_prior @ off
        ratio.append(square / stands.error**2)
        below.append(np.sqrt(square) <= stands.at_most)
    assert 0.6 < np.mean(ratio) < 1.6
    assert np.mean(below) >= 0.87


@pytest.mark.long
def test_what_more_poses_are_foreseen_to_bring_is_what_they_bring(bench):
    """Arms of which few effects act: the sizes of the others shrink while it is measured, and that is foreseen."""
    foreseen, as_learnt = [], []
    for seed in range(0, 8, 2):
        live = begun(bench)
        _, readings = draw_arm(live, seed, 0.15)
        half = live.add_all(read_at(readings[:30]))
        all_read = [*live.read, *live.unread_poses()]
        still = np.sqrt(live.posterior.square(all_read))  # with the sizes as they are learnt by now
        came = live.add_all({k: r for k, r in read_at(readings).items() if k >= 30})
        foreseen.append(half.then / came.error)
        as_learnt.append(still / came.error)
    assert 0.75 < np.median(foreseen) < 1.6
    assert np.median(as_learnt) > 2.0 * np.median(foreseen)


def test_sizes_are_those_that_were_drawn_and_what_is_not_seen_pulls_nowhere():
    rng = np.random.default_rng(1)
    family = np.repeat([0, 1], 60)
    truth = np.where(family == 0, 3.0, 0.5) * rng.standard_normal(120)
    shown = np.tile(10.0 * np.eye(120)[:60], (3, 1))  # three readings each; nothing is seen of the second family
    families = Families(family, np.array([False, False]), np.array([ALWAYS, ALWAYS]))
    found = learn_errors(shown, shown @ truth + rng.standard_normal(180), families)
    assert found.factors[0] == pytest.approx(3.0, rel=0.25)
    assert found.noise == pytest.approx(1.0, abs=0.15)
    usual, weight = families.factors(1)
    assert found.factors[1] == pytest.approx(np.sqrt(weight @ usual**2), rel=1e-3)


def test_what_most_robots_do_not_show_is_found_where_it_is_and_not_elsewhere():
    """Twelve families of gears, two of which act; how large the noise is the readings say."""
    rng = np.random.default_rng(2)
    family = np.repeat(np.arange(12), 10)
    size = np.where(np.arange(12) < 2, 1.5, 0.0)
    shown = 8.0 * rng.standard_normal((90, 120)) / np.sqrt(12)
    truth = size[family] * rng.standard_normal(120)
    families = Families(family, np.zeros(12, dtype=bool), np.full(12, MOSTLY))
    found = learn_errors(shown, shown @ truth + rng.standard_normal(90), families)
    assert found.factors[:2] == pytest.approx(1.5, rel=0.5)
    assert found.factors[2:].max() < 0.35
    for noise in (4.0, 0.4):  # an arm comes to rest worse or better than it is said to
        other = learn_errors(shown, shown @ truth + noise * rng.standard_normal(90), families)
        assert other.noise == pytest.approx(noise, rel=0.35)


@pytest.mark.slow
def test_errors_of_centimetres_are_no_noise_though_the_model_bends_there(bench):
    """An arm ten times as bad as usual: its tool errs by centimetres, where a straight model is millimetres off."""
    live = begun(bench)
    rng = np.random.default_rng(4)
    model, root = live.unknown.model, live.unknown.root
    known = [k for k, p in enumerate(model.parameters) if p.group == "geometry"]
    truth = np.zeros(len(model.parameters))
    truth[known] = 10.0 * (root @ rng.standard_normal(root.shape[1]))[known]
    noise = model.noise(live.samples)
    straight = model.reading(live.samples, live.mean)[:, 0] + model.rows(live.samples)[:, 0] @ truth
    read = model.reading(live.samples, live.mean + truth)[:, 0]
    assert np.abs(read - straight).max() > 20 * noise.max()
    stands = live.add_all(read_at(read + noise * rng.standard_normal(len(noise))))
    assert live.posterior.learnt.noise < 2.0
    off = np.array(live.off) - live.posterior.white @ live.posterior.learnt.mean
    assert np.sqrt((off**2).mean()) < 2.0
    assert stands.error < 1e-3


def advice(bench, tmp_path, until):
    poses = [
        Of(id=k + 1, role="validate" if is_validation(k) else "calibrate", fixture="A", length_mm=1e3 * length)
        for k, length in enumerate(bench.made.length)
    ]
    numbers = {p.id: n for n, p in enumerate(p for p in poses if p.role == "calibrate")}
    return LiveAdvice(begun(bench, until, True), numbers, tmp_path / "run.progress.csv"), poses


@pytest.mark.slow
def test_it_stops_at_the_goal_and_never_passes_a_validation_pose(bench, tmp_path):
    adviser, poses = advice(bench, tmp_path, 0.1e-3)
    length = dict(zip((p.id for p in poses), bench.made.length, strict=True))
    begun_with = poses[:36]  # the session goes on after these
    rows = {p.id: (0.0, length[p.id]) for p in begun_with}
    adviser.estimate.add_all(read_at([length[p.id] for p in begun_with if p.role == "calibrate"]))
    before = len(adviser.estimate.read)
    log = Of(poses=tuple(poses), rows=rows, add=lambda pose, t, value: rows.__setitem__(pose, (t, value)),
             is_readable=lambda pose, length: True, is_stuck=lambda: False)  # fmt: skip
    asked = []

    def ask(text):
        if text.startswith("pose"):
            asked.append(int(text.split()[1]))
        return ""

    clock = iter(np.arange(0.0, 1e4, 12.0)).__next__
    said = list(MeasuringSession(log, ask, clock, lambda: length[asked[-1]], adviser=adviser).run())
    passed = [p.id for p, line in zip(poses[len(begun_with) :], said, strict=True) if "drive on" in line]
    validation = {p.id for p in poses if p.role == "validate"}
    assert passed
    assert not validation & set(passed)
    assert validation <= set(rows)
    assert len(adviser.estimate.samples) == len(poses) - len(validation)
    assert len(adviser.estimate.read) >= FEWEST_READ
    assert adviser.estimate.reached
    assert any("more poses, about" in line for line in said)
    assert any(": 0.1 mm is reached" in line for line in said)
    table = (tmp_path / "run.progress.csv").read_text().splitlines()
    assert table[0] == "pose,t_s,expected_mm,at_most_mm"
    assert len(table) == 1 + len(adviser.estimate.read) - before
    assert not validation & {int(line.split(",")[0]) for line in table[1:]}


@pytest.mark.slow
def test_a_reading_that_does_not_fit_is_told(bench, tmp_path):
    adviser, poses = advice(bench, tmp_path, 1e-6)
    last = poses[-1]
    others = [length for p, length in zip(poses, bench.made.length, strict=True) if p.role == "calibrate"][:-1]
    adviser.estimate.add_all(read_at(others))
    said = adviser.advise(last.id, 10.0, bench.made.length[-1] + 2e-3)
    assert "sigma from what was expected: read it again" in said


def test_a_goal_out_of_reach_says_so(bench, tmp_path):
    adviser, poses = advice(bench, tmp_path, 1e-6)
    said = adviser.advise(poses[0].id, 10.0, bench.made.length[0])
    assert "not 0.001 mm: then plan on with edbb plan --after" in said
    then, limit = (float(re.search(rf"{word} ([\d.]+) mm(?= and|, 95)", said)[1]) for word in ("bring", "below"))
    assert 0.001 < then < limit  # the error may be below a goal that its limit misses: the limit is said as well


@pytest.mark.slow
def test_where_no_pose_is_left_none_is_offered(bench, tmp_path):
    adviser, poses = advice(bench, tmp_path, 1e-6)
    *others, last = [p for p in poses if p.role == "calibrate"]
    adviser.estimate.add_all(read_at([1e-3 * p.length_mm for p in others]))
    said = adviser.advise(last.id, 10.0, 1e-3 * last.length_mm)
    assert said.endswith("; no pose is left and 0.001 mm is not reached: plan on with edbb plan --after")


@pytest.mark.long
def test_the_command_reads_until_the_goal_and_goes_on_where_it_was_left(tmp_path, monkeypatch):
    """The gauge shows the length of the nominal arm and 0.3 mm more; the second call takes up what was read."""
    plan = wide_plan(tmp_path, calibrate=45, validate=5, repeat=0)
    poses, cell = json.loads(plan.read_text())["poses"], load_cell(str(plan.parent / "cell.toml"), planning=False)
    shown = 1e3 * cell.bar_length(np.radians([p["q_deg"] for p in poses]), Mounting(0, 0)) + 0.3
    length = dict(zip((p["id"] for p in poses), shown.tolist(), strict=True))
    gauge, asked = Gauge(), []

    def ask(text):
        if not text.startswith("pose"):
            return "q"
        asked.append(int(text.split()[1]))
        gauge.shown = length[asked[-1]]
        time.sleep(0.05)
        return "q" if len(asked) == 12 else ""

    monkeypatch.setattr(cell_commands, "_ask", ask)
    words = ["measure", plan, "--serial-port", gauge.port, "--until-mm", "6", "-o", tmp_path / "run.csv"]
    first, second = edbb(*words), edbb(*words)
    gauge.on = False
    assert first.returncode == second.returncode == 0, first.screen + second.screen
    assert "11 of 50 poses are measured" in first.screen
    assert "6 mm is reached" in second.screen
    assert "drive on, the goal is reached" in second.screen
    validation = {p["id"] for p in poses if p["role"] == "validate"}
    measured = {p for k, p in enumerate(asked) if k != 11}
    assert len(validation) == 5
    assert validation <= measured
    assert len(measured) == FEWEST_READ + 5
