"""Minutes to a stated bound: a gauge read until it is good enough, against sets of poses that are fixed beforehand.

``python -m tests.benchmarks.stopping LOG.jsonl``.
``--processes 16 --time-limit-s 500`` on a larger machine.
Arms are those of ``tests.independent_arms``, which share nothing with the planner's code: 0 to 3 hidden causes of the
catalogue, every other arm with one that no catalogue has. All ways choose among the same poses in the bar's shell:

- ``led on``: an electronic gauge, an arm that is led on: poses that lower most, in a second of way and reading, what is
  not known; 20 of them, then 20 more of which the first of their tour (``step``) are driven before the next are chosen;
- ``measure``: ``edbb measure --until-mm``: a plan of 120 poses in the order of its tour, until the bound is reached;
- ``batches``: programs of as many poses as are expected to reach the bound, the gauge left standing;
- ``batches anew``: batches with the gauge set up anew for each;
- ``plan``: a plan of nothing known, chosen by the error that it leaves;
- ``plan's own number``: the same, of as many poses as ``edbb plan`` chooses by itself;
- ``by the minute``: a plan of nothing known, chosen by what a pose takes off the error in a second;
- ``d-optimal``: the largest determinant of the information on the geometry, taken greedily;
- ``next-view``: a pose at a time by the trace of the geometry's covariance, after arXiv 2303.06766; the arm is led to
  each as it is chosen, and stops by the same bound;
- ``next-view set``: the first of these as a set that is fixed beforehand, in a tour;
- ``oracle``: ``by the minute`` by one who knows how large the effects of this very arm are (as all poses show them).

Readings are those of the true arm with all its causes, in their order of time; the estimate is the one that ``edbb
measure`` makes at the cell (sizes and noise learnt, causes without a name among them, one step), whose limit stops. The
true error is that of the tool against the model's mean, over the workspace. Legs take as long as the planner's tour
estimates them; paths are not proven. Sets that are fixed are asked after 20 to 180 poses (``SETS``), in one tour each.
Which number is enough for the arm at hand nobody knows beforehand: they are shown with one number for all arms
(``stopping_tables.equal_truth``), with the number that ``edbb plan`` chooses by itself, and as if an oracle had known
the number of each arm. One line of LOG an arm and its ways; what is there is not done again. Needs numpy, scipy,
pydantic, polars and highspy, no package of planning.
"""

import argparse
import json
import multiprocessing
import tempfile
import time
from bisect import bisect_left
from concurrent.futures import ProcessPoolExecutor, as_completed
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from planner.cell.reading import load_cell
from planner.design.assumptions import MOST_POSES, UNTRACED_TARGET_SHARE
from planner.design.bayesian_design import BayesianPosterior, select_greedily
from planner.design.free_parameters import undeclared_errors
from planner.design.learnt_sizes import LearntErrors, LearntForesight, LearntPosterior, root_of
from planner.design.unnamed_errors import add_unnamed_errors
from planner.model.tool_error import tool_rows
from planner.next_session.live_estimate import families
from planner.runs.run import Mounting, Readings, Samples
from planner.session.tour_cost import tour_costs
from tests.benchmarks import stopping_tables
from tests.benchmarks.stopping_tables import FIXED, GOALS_MM, OWN, WAYS, best, coverage, equal_truth, figures, table
from tests.independent_arms import runs
from tests.independent_arms.arm import TOOL, make_arm
from tests.independent_arms.chain import frames, points
from tests.independent_arms.judge import evaluation_states, model_error, rms_aligned
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.poses import at_targets, shell_points

FIRST, FEW, MOST = 20, 5, 180  # poses: first, a step at least, at most
SETS = (20, 30, 40, 50, 60, 80, 100, 120, 140, 160, 180)  # poses of a fixed set
AHEAD, OF_A_PLAN = 20, 120  # poses looked ahead where an arm is led on; of a plan that is measured until it is enough
SMALLEST, LARGEST = 10, 80  # poses of a batch
IDENTIFIED_MM = None  # goal at which what batches brought is identified as well; set by --identify
READ_S = 6.0  # [s] a pose: rest, settle, read
PROGRAM_MIN, SET_UP_MIN = 3.0, 5.0  # [min] to carry a log away and a program back; to set a bar up, and its zero
SHARE_OF_PLACE = 1e-2  # of what is unknown of the gauge's place, in greedy choices: else it comes first


class Worth:
    """What each candidate would take off the mean square error of the tool, after those that are taken, (n,) [m²].

    Kept among the candidates: G, how they covary (n, n), and H, what each tells of the tool (n, r).
    """

    def __init__(self, white, root, taken):
        told, told_tool = white[taken] @ white.T, white[taken] @ root
        lower = np.linalg.cholesky(np.eye(len(taken)) + told[:, taken])
        seen = solve_triangular(lower, told, lower=True, check_finite=False)
        self.together = white @ white.T - seen.T @ seen
        self.tool = white @ root - seen.T @ solve_triangular(lower, told_tool, lower=True, check_finite=False)

    def gains(self):
        return np.einsum("ij,ij->i", self.tool, self.tool) / (1.0 + np.diagonal(self.together))

    def take(self, k):
        own = self.together[k] / (1.0 + self.together[k, k])
        self.tool -= np.outer(own, self.tool[k])
        self.together -= np.outer(own, self.together[k])


def shorten(legs, path, fixed_start):
    """A path that no exchange of two legs and no move of up to three poses in a row makes shorter."""
    nodes = np.array(path)
    cost = np.zeros((len(nodes) + 1,) * 2)  # behind the last pose one that is next to all: the path is a closed tour
    cost[:-1, :-1] = legs[np.ix_(nodes, nodes)]
    if fixed_start:
        cost[0, -1] = cost[-1, 0] = -1e6  # [s]: the tour keeps this leg
    tour = np.arange(len(cost))
    while (better := exchange(cost, tour)) is not None or (better := move(cost, tour)) is not None:
        tour = better
    tour = np.roll(tour, -1 - int(np.argmax(tour == len(nodes))))[:-1]
    return nodes[tour[::-1] if fixed_start and tour[0] else tour].tolist()


def exchange(cost, tour):
    """The tour with the best part turned round, or None."""
    n, after = len(tour), np.roll(tour, -1)
    legs = cost[tour, after]
    change = cost[np.ix_(tour, tour)] + cost[np.ix_(after, after)] - legs[:, None] - legs
    change[np.tril_indices(n)] = 0.0
    i, j = np.unravel_index(np.argmin(change), change.shape)
    if change[i, j] > -1e-6:  # [s]
        return None
    return np.concatenate([tour[: i + 1], tour[i + 1 : j + 1][::-1], tour[j + 1 :]])


def move(cost, tour):
    """The tour with the best part of one to three poses moved elsewhere, either way round, or None."""
    n, best = len(tour), (-1e-6, None)
    for size in range(1, min(4, n - 2)):
        at = np.arange(n)
        first, last = tour, np.roll(tour, 1 - size)
        before, behind = np.roll(tour, 1), np.roll(tour, -size)
        saved = cost[before, first] + cost[last, behind] - cost[before, behind]
        here, there = tour, np.roll(tour, -1)
        legs = cost[here, there]
        within = (at - at[:, None]) % n
        barred = (within < size) | (within == n - 1)
        for turned, (a, b) in enumerate(((first, last), (last, first))):
            change = cost[np.ix_(a, here)] + cost[np.ix_(b, there)] - legs - saved[:, None]
            change[barred] = 0.0
            k = int(np.argmin(change))
            if change.flat[k] < best[0]:
                best = change.flat[k], (*divmod(k, n), size, turned)
    if best[1] is None:
        return None
    i, j, size, turned = best[1]
    turn = np.roll(tour, -i)  # the part is now at the head
    part, rest = turn[:size], turn[size:]
    place = (j - i) % n - size + 1
    return np.concatenate([rest[:place], part[::-1] if turned else part, rest[place:]])


def samples(q):
    return Samples(q, np.zeros(len(q), dtype=int))


class Bench:
    """What all arms share: poses (n, 6) [rad], what is unknown, legs [s], the tool at states of the workspace."""

    def __init__(self):
        self.cell = load_cell(str(runs.CELLS["bar"]), planning=False)
        rng = np.random.default_rng(1)
        arm, tool = Arm.from_toml("comau-nj130"), np.array([0.050, 0.0, 0.150])
        q = at_targets(arm, shell_points(runs.FIXTURE, np.array([0.308, 0.512]), 500, rng, 1.3), tool, rng)
        self.q = q[~np.isnan(q[:, 0])]
        self.unknown = undeclared_errors(self.cell, samples(self.q))
        self.white = self.unknown.white(samples(self.q))
        self.noise = self.unknown.model.noise(samples(self.q))
        self.live = add_unnamed_errors(self.unknown, self.cell, samples(self.q))
        self.live_white = self.live.white(samples(self.q))
        self.nominal = self.unknown.model.reading(samples(self.q), np.zeros(len(self.unknown.prior)))[:, 0]
        self.families = families(self.live)
        of_map = np.array([p.name.startswith("map") for p in self.unknown.model.parameters])
        self.anew = self.live.of_gauge & ~np.append(of_map, np.zeros(len(self.live.family) - len(of_map), dtype=bool))
        self.legs = tour_costs(self.cell, Mounting(), self.q)
        self.tours = {}
        self.root = self.few_directions(root_of(self.live.weight_per_prior))
        self.states = evaluation_states(make_arm(0, "bar", 0, False).arm, 0)
        effects = [p for p in self.live.model.parameters if p.is_effect]
        names, _, rows = tool_rows(samples(self.states), self.live.model.setup, effects)
        at = {n: k for k, n in enumerate(names)}
        moving = [k for k, n in enumerate(self.live.model.names) if n in at]
        self.tool = rows[:, [at[self.live.model.names[k]] for k in moving]] @ self.live.root[moving]

    def few_directions(self, root):
        """The root of the weight in the directions of the tool's error that count once the first poses are read."""
        first = self.live_white[self.order("by the minute")[:FIRST]]
        told = np.linalg.solve(np.eye(len(first)) + first @ first.T, first @ root)
        left, axes = np.linalg.eigh(root.T @ root - (first @ root).T @ told)
        # 1e-3: of the mean square error after these poses, in directions in which hardly anything moves
        return root @ axes[:, np.cumsum(left) > 1e-3 * left.sum()]

    def quick(self, white, root, taken, count, start):
        """Further poses by what they take off the error in a second of reading and of way: in order, and as a path."""
        known = Worth(white, root, taken)
        path, order = [] if start is None else [start], []
        for _ in range(count):
            way, inserted = np.zeros(len(white)), None
            if path:
                way = self.legs[path[-1]].copy()
                at = np.full(len(white), len(path))
                if start is None:
                    at[self.legs[path[0]] < way] = 0
                    way = np.minimum(way, self.legs[path[0]])
                a, b = path[:-1], path[1:]
                if a:
                    between = self.legs[a] + self.legs[b] - self.legs[a, b][:, None]
                    at = np.where(between.min(axis=0) < way, 1 + between.argmin(axis=0), at)
                    way = np.minimum(way, between.min(axis=0))
                inserted = at
            worth = np.maximum(known.gains(), 0.0) / (READ_S + way)
            worth[[*taken, *path]] = -1.0
            k = int(np.argmax(worth))
            known.take(k)
            order.append(k)
            path.insert(0 if inserted is None else int(inserted[k]), k)
        return order, path

    @cache  # noqa: B019 - there is one
    def order(self, way):
        """Positions in the order in which a way that knows nothing of the robot takes them."""
        start = np.where(self.unknown.of_gauge, SHARE_OF_PLACE, 1.0)
        if way == "by the minute":
            return self.quick(self.white * start, root_of(self.unknown.weight_per_prior), [], MOST, None)[0]
        if way == "plan":
            begun_with = BayesianPosterior.prior(self.white * start, self.unknown.weight_per_prior)
            return list(select_greedily(begun_with, MOST, 0.0))
        of_geometry = np.array([not p.is_effect for p in self.unknown.model.parameters])
        rows, order = self.white[:, of_geometry], []
        covariance = np.eye(rows.shape[1])
        for _ in range(MOST):
            seen = rows @ covariance
            spread = 1.0 + np.einsum("ij,ij->i", seen, rows)
            gain = np.log(spread) if way == "d-optimal" else (seen**2).sum(axis=1) / spread
            gain[order] = -np.inf
            k = int(np.argmax(gain))
            covariance = covariance - np.outer(seen[k], seen[k]) / spread[k]
            order.append(k)
        return order

    @cached_property
    def own_number(self):
        """Poses of a plan that nobody has given a number."""
        start = np.where(self.unknown.of_gauge, SHARE_OF_PLACE, 1.0)
        begun_with = BayesianPosterior.prior(self.white * start, self.unknown.weight_per_prior)
        return len(select_greedily(begun_with, MOST_POSES, UNTRACED_TARGET_SHARE * self.unknown.untraced_error))

    def toured(self, which, start=None):
        """The poses in the order of a short path, and its minutes; from pose ``start`` where the arm stands at one."""
        order = shorten(self.legs, [*([] if start is None else [start]), *which], start is not None)
        drive = sum(self.legs[a, b] for a, b in pairwise(order))
        kept = order if start is None else order[1:]
        return kept, (drive + READ_S * len(kept)) / 60

    def fixed(self, way, count):
        """The first poses of a fixed way as they are toured, and its minutes."""
        if (way, count) not in self.tours:
            self.tours[way, count] = self.toured(self.order(way)[:count])
        return self.tours[way, count]


@dataclass
class Session:
    """An arm that is measured: readings come in their order of time; what the estimate says, and what is true."""

    bench: Bench
    seed: int
    anew: bool = False

    def __post_init__(self):
        b = self.bench
        self.true = make_arm(self.seed, "bar", self.seed % 4, bool(self.seed % 2))
        rng = np.random.default_rng([self.seed, 5])
        self.rest = rng.normal(0, self.true.joint_noise, b.q.shape)
        self.noise = rng.normal(0, self.true.noise, len(b.q))
        self.rng, self.taken, self.off, self.minutes = rng, [], np.zeros(0), 0.0
        self.time, self.length = np.zeros(0), np.zeros(0)
        self.white, self.families = b.live_white, b.families
        self.root, self.stands = b.root, b.anew
        self.fixture, self.zero = None, 0.0
        self.posterior = None

    def set_up(self, first):
        """Set the gauge up: by hand, where the robot shows it."""
        self.fixture = runs.fixture_as_set_up(self.true, self.bench.q[first], self.rng)
        if not self.anew or not self.taken:
            return
        b, free = self.bench, np.flatnonzero(self.bench.anew)
        self.zero = self.rng.normal(0, 0.05e-3)
        later = np.setdiff1d(np.arange(len(b.q)), self.taken)
        here, more = self.white.copy(), np.zeros((len(b.q), len(free)))
        here[np.ix_(later, np.flatnonzero(self.stands))] = 0.0
        more[later] = b.live_white[later][:, free]
        self.white = np.concatenate([here, more], axis=1)
        self.stands = np.concatenate([self.stands, np.ones(len(free), dtype=bool)])
        number = np.concatenate([self.families.number, self.families.number[free]])
        self.families = replace(self.families, number=number)
        self.root = np.pad(self.root, ((0, len(free)), (0, 0)))

    def read(self, which, minutes):
        """Read poses, in that order, which takes so many minutes."""
        b, true = self.bench, self.true
        time = 60 * (self.minutes + minutes * (1 + np.arange(len(which))) / len(which))
        q = b.q[which]
        length = runs.bar_lengths(true, q, time, self.rest[which], self.fixture) + self.zero + self.noise[which]
        target = b.unknown.model.setup.targets(samples(q), Readings(length=length)).length
        self.off = np.append(self.off, (target - b.nominal[which]) / b.noise[which])
        self.time, self.length = np.append(self.time, time), np.append(self.length, length)
        self.taken = [*self.taken, *which]
        self.minutes += minutes
        start = LearntErrors.usual(len(self.root), len(self.families))
        self.posterior = LearntPosterior(self.white, self.root, self.families, start)
        self.posterior.learn(self.taken, self.off)

    def count_until(self, chosen, goal):
        """How many of the poses chosen, in their order, are expected to bring the bound below a goal [mm]."""
        ahead = LearntForesight.of(self.posterior, self.taken, self.off, chosen)
        counts = range(SMALLEST, len(chosen) + 1, FEW)
        enough = bisect_left(counts, True, key=lambda n: 1e3 * ahead.square_error_limit(n) ** 0.5 <= goal)
        return counts[min(enough, len(counts) - 1)]

    def choose(self, count, start=None):
        """The poses that lower most in a second what is still unknown, from where the arm stands: order and path."""
        size = self.posterior.learnt.factors[self.families.number]
        white = self.white * size / self.posterior.learnt.noise
        return self.bench.quick(white, self.root * size[:, None], self.taken, count, start)

    def stand(self):
        """Where the session stands: poses, minutes, bound, stated and true error [mm]."""
        b, p = self.bench, self.posterior
        errors = p.learnt.mean[: b.tool.shape[1]]
        moment = {"time": 30 * self.minutes, "warm": runs.warming(30 * self.minutes)}
        meant = points(frames(self.true.arm, b.states)[6], TOOL) + (b.tool @ errors).reshape(-1, 3)
        off = rms_aligned(self.true.points(b.states, **moment), meant)
        unknown = b.unknown
        stated, bound = unknown.state(p.square(self.taken)), unknown.state_limit(p.square_error_limit(self.taken))
        return {
            "poses": len(self.taken),
            "minutes": self.minutes,
            "bound": 1e3 * bound,
            "stated": 1e3 * stated,
            "true": off,
        }


def identified(session):
    """The same poses by ``edbb identify``, as it states them, and the true error of the tool that it corrects [mm]."""
    from planner.workflow.identification import identify  # needs more packages than all else here

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        columns = runs.columns_at_rest(session.bench.q[session.taken], session.time)
        runs.write_run(columns | {"length_mm": 1e3 * session.length}, folder / "run.csv")
        found = identify(folder / "run.csv", cell=runs.CELLS["bar"], no_trace=True)
        (folder / "known").mkdir()
        found.write_robot(folder / "known")
        model, release = folder / "known" / "robot.toml", found.calibration.release
        off = model_error(session.true, session.bench.states, model, folder, runs.middle(session.time))[0]
    return {"bound": 1e3 * release.at_most, "stated": 1e3 * found.calibration.workspace_error, "true": off}


def judge_way(bench, seed, way):
    """By goal [mm] where an arm stands when its bound is below it, as ``Session.stand`` says; the last row if never.

    Of fixed ways the true error after each number of poses as well.
    """
    if way.startswith("batches"):
        first = begun(bench, seed, 30, way == "batches anew")  # fewer tell nothing of gears
        return {str(goal): batches_to(copy(first), way, goal) for goal in GOALS_MM}
    asked = {"led on": led_rows, "measure": measured_rows, "next-view": viewed_rows, "oracle": oracle_rows}
    if way == OWN:
        session = Session(bench, seed)
        session.set_up(bench.fixed("plan", bench.own_number)[0])
        session.read(*bench.fixed("plan", bench.own_number))
        return dict.fromkeys(map(str, GOALS_MM), session.stand())
    rows = list(asked[way](bench, seed) if way in asked else fixed_rows(bench, seed, way))
    found = {str(goal): next((r for r in rows if r["bound"] <= goal), rows[-1]) for goal in GOALS_MM}
    if way in FIXED:
        found["rows"] = [[r["poses"], r["minutes"], r["bound"], r["true"]] for r in rows]
    return found


def fixed_rows(bench, seed, way):
    """Rows after 20, 25 … poses, each number in a tour of its own."""
    for count in SETS:
        session = Session(bench, seed)
        which, minutes = bench.fixed(way, count)
        session.set_up(which)
        session.read(which, minutes)
        yield session.stand()


def oracle_rows(bench, seed):
    """Rows of sets that are chosen by the sizes that all poses show, until the smallest goal is reached."""
    told = Session(bench, seed)
    told.set_up(bench.order("plan")[:FIRST])
    told.read(list(range(0, len(bench.q), 2)), 60.0)
    size = told.posterior.learnt.factors[told.families.number]
    start = np.where(bench.live.of_gauge, SHARE_OF_PLACE, 1.0)
    white = bench.live_white * size * start / told.posterior.learnt.noise
    order, _ = bench.quick(white, told.root * size[:, None], [], 100, None)
    for count in (c for c in SETS if c <= len(order)):
        session = Session(bench, seed)
        which, minutes = bench.toured(order[:count])
        session.set_up(which)
        session.read(which, minutes)
        yield (row := session.stand())
        if row["bound"] <= min(GOALS_MM):
            return


def begun(bench, seed, count, anew=False):
    """A session after its first poses."""
    session = Session(bench, seed, anew)
    which, minutes = bench.fixed("by the minute", count)
    session.set_up(which)
    session.read(which, minutes)
    return session


def drive(bench, session, order):
    """Read poses in this order, from where the arm stands."""
    way = [*session.taken[-1:], *order]
    seconds = sum(bench.legs[a, b] for a, b in pairwise(way)) + READ_S * len(order)
    session.read(order, seconds / 60)


def step(session):
    """Poses that are read before it is asked anew where the session stands: five, later a tenth of what was read."""
    return min(max(FEW, len(session.taken) // 10), MOST - len(session.taken))


def led_rows(bench, seed):
    """Rows of an arm that is led on."""
    session = begun(bench, seed, FIRST)
    yield (row := session.stand())
    while row["bound"] > min(GOALS_MM) and len(session.taken) < MOST:
        start = session.taken[-1]
        _, path = session.choose(AHEAD, start)
        drive(bench, session, shorten(bench.legs, path, True)[1:][: step(session)])
        yield (row := session.stand())


def viewed_rows(bench, seed):
    """Rows of an arm that is led from pose to pose as the geometry's covariance chooses them, in no tour."""
    session = Session(bench, seed)
    order = bench.order("next-view set")
    session.set_up(order[:FIRST])
    drive(bench, session, order[:FIRST])
    yield (row := session.stand())
    while row["bound"] > min(GOALS_MM) and (read := len(session.taken)) < MOST:
        drive(bench, session, order[read : read + step(session)])
        yield (row := session.stand())


def measured_rows(bench, seed):
    """Rows of a plan that is measured pose by pose in the order of its tour."""
    session = Session(bench, seed)
    which, _ = bench.fixed("plan", OF_A_PLAN)
    session.set_up(which)
    drive(bench, session, list(which[:30]))  # so many are read whatever is expected
    yield (row := session.stand())
    while row["bound"] > min(GOALS_MM) and (read := len(session.taken)) < len(which):
        drive(bench, session, list(which[read : read + step(session)]))
        yield (row := session.stand())


def batches_to(session, way, goal):
    """Where an arm stands that is measured on in programs until its bound is below a goal [mm]."""
    bench, anew = session.bench, way == "batches anew"
    while (row := session.stand())["bound"] > goal and len(session.taken) + SMALLEST <= MOST:
        session.minutes += PROGRAM_MIN
        if anew:
            session.set_up(session.taken)
            session.minutes += SET_UP_MIN
        most = min(LARGEST, MOST - len(session.taken))
        chosen, _ = session.choose(most)
        session.read(*bench.toured(chosen[: session.count_until(chosen, goal)]))
    return row | ({"identified": identified(session)} if goal == IDENTIFIED_MM and way == "batches" else {})


def judge_arm(seed):
    """A line of the log; ``WORK`` holds what all arms share, in every process."""
    bench, ways = WORK
    best = {"best": best_bound(bench, seed)} if "oracle" in ways else {}
    return {"seed": seed, **best, "ways": {way: judge_way(bench, seed, way) for way in ways}}


def best_bound(bench, seed):
    """What every second of all poses states [mm]: hardly any choice among them could state less."""
    session = Session(bench, seed)
    session.set_up(bench.order("plan")[:FIRST])
    session.read(list(range(0, len(bench.q), 2)), 60.0)
    return session.stand()["bound"]


def tour_of(asked):
    """The tour of a fixed way and number, for the other processes."""
    return asked, WORK[0].fixed(*asked)


WORK = None


def judge_arms(log, seeds, ways, processes, limit_s):
    """Write a line an arm into the log, until all are done or the time is over."""
    global WORK
    began, context = time.monotonic(), multiprocessing.get_context("fork")
    WORK = bench, _ = Bench(), ways
    needed = {w for w in ways if w in FIXED} | {"by the minute"}
    asked = [(way, count) for way in needed for count in SETS] + [
        ("plan", OF_A_PLAN),
        ("plan", bench.own_number),
    ]
    for way in {way for way, _ in asked}:
        bench.order(way)
    with ProcessPoolExecutor(processes, context) as pool:
        bench.tours |= dict(pool.map(tour_of, asked))
    with ProcessPoolExecutor(processes, context) as pool, log.open("a") as file:
        ahead = iter(seeds)
        running = {pool.submit(judge_arm, seed) for seed in islice(ahead, processes)}
        while running:
            done = next(as_completed(running))
            running.remove(done)
            file.write(json.dumps(done.result()) + "\n")
            file.flush()
            if time.monotonic() - began < limit_s:
                running |= {pool.submit(judge_arm, seed) for seed in islice(ahead, 1)}


def read_log(log):
    """The lines of a log by seed; what several lines say of an arm is one line."""
    arms = {}
    for line in (json.loads(text) for text in log.read_text().splitlines()) if log.exists() else ():
        ways = arms.get(line["seed"], {"ways": {}})["ways"] | line["ways"]
        arms[line["seed"]] = arms.get(line["seed"], {}) | line | {"ways": ways}
    return arms


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("--arms", type=int, default=50)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--identify", type=float, metavar="MM", help="identify as well where batches reach this bound")
    parser.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS)
    parser.add_argument("--sets", nargs="+", type=int, default=SETS, help="poses of fixed sets")
    parser.add_argument("--goals", nargs="+", type=float, metavar="MM", default=GOALS_MM, help="bounds to stop at")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--time-limit-s", type=float, default=np.inf, help="begin no further arm after this")
    parser.add_argument("--figures", type=Path, help="write the minutes of all arms here")
    parser.add_argument("--table", action="store_true", help="only print the table of what stands in the log")
    given = parser.parse_args()
    globals().update(IDENTIFIED_MM=given.identify, SETS=given.sets, GOALS_MM=given.goals)
    stopping_tables.GOALS_MM = given.goals
    done = read_log(given.log)
    seeds = range(given.first_seed, given.first_seed + given.arms)
    seeds = [s for s in seeds if not set(given.ways) <= set(done.get(s, {"ways": {}})["ways"])]
    if seeds and not given.table:
        judge_arms(given.log, seeds, given.ways, given.processes, given.time_limit_s)
    lines = [line for _, line in sorted(read_log(given.log).items())]
    if given.figures:
        given.figures.write_text(json.dumps(figures(lines), indent=1) + "\n")
    print(table(lines), best(lines), equal_truth(lines), coverage(lines), sep="\n\n")


if __name__ == "__main__":
    main()
