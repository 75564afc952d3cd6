"""From the run of a check to its verdict: has anything changed since the baseline, what most likely, and what to do.

What has changed, by probability: all that may have is weighed as an identification weighs the causes of a finding.

A change is a cause whose size is one of a few, over the orders of magnitude, and its values are averaged over (the
marginal likelihood of ``identification.comparison``). So is the noise, which the baseline knows as well as its readings
were many. One reading that is wrong is a cause as well, and so is what has no name: each reading off by itself. That
something has changed is for the alarm to say (``detection``); the probabilities are of what, if anything has.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.checks.assumptions import FEWEST_READINGS
from planner.checks.detection import Detector, Explanation
from planner.common.errors import InputError
from planner.common.lazy_modules import stats
from planner.common.numbers import number_of
from planner.common.units import Array
from planner.documents.baseline import Baseline
from planner.effects.backlash import ApproachDirection
from planner.effects.basis import ONE, BasisFunction
from planner.effects.effect import Parameter, transform_move
from planner.effects.gears import WAVES, JointWave
from planner.fit.run_setup import add_motion
from planner.inference.candidates import HUNDRED_TO_ONE
from planner.inference.comparison_columns import Block
from planner.inference.model_comparison import ConditionalProducts
from planner.model.model import Model
from planner.model.tool_error import tool_rows, uniform_states
from planner.runs.run import Run, Samples


@dataclass(frozen=True)
class ChangeProbabilities:
    """How likely it was each, together 1.

    ``changes`` (h,) as the detector has them; ``anything``: what has no name; ``readings`` (n,): that one was wrong.
    """

    changes: Array
    anything: float
    readings: Array

    @property
    def wrong_reading(self) -> int | None:
        """Number of the reading that is wrong more likely than anything else."""
        likeliest = int(np.argmax(self.readings))
        others = max(self.anything, float(self.changes.max(initial=0.0)))
        return likeliest if self.readings[likeliest] > others else None


def weigh_changes(detector: Detector, units: Sequence[Array], difference: Array, readings: int) -> ChangeProbabilities:
    """Weigh all that may have changed.

    Args:
        detector: with the columns of h changes.
        units: values (d,) by which each parameter of a change moves the tool by as much as the others, by a metre [m,
            rad per m], of every change.
        difference: readings less what is expected, (m,) [m], of so many ``readings`` at a pose each.
    """
    each = np.split(np.eye(len(difference)), readings, axis=1)
    columns = [*(c * u for c, u in zip(detector.columns, units, strict=True)), np.eye(len(difference)), *each]
    white = np.column_stack([detector.white(np.column_stack(columns)), detector.white(difference)])
    gram, ends = white.T @ white, np.cumsum([0, *(c.shape[1] for c in columns)])
    sizes = np.geomspace(1e-5, 1e-2, 13)  # [m] of the tool, or of a reading: ten micrometres to ten millimetres
    # one of all readings is wrong as likely as one change has come about
    handicap = np.append(np.zeros(len(units) + 1), np.full(readings, np.log(readings)))
    blocks = [
        Block("", np.arange(a, b), sizes / np.sqrt(b - a), np.full(len(sizes), -float(h) - np.log(len(sizes))))
        for a, b, h in zip(ends[:-1], ends[1:], handicap, strict=True)
    ]
    middles = (np.arange(12) + 0.5) / 12  # sizes that the noise may have, as likely each
    noises = np.sqrt(detector.freedom / stats.chi2.ppf(middles, detector.freedom))
    logs = np.logaddexp.reduce([_log_densities(gram, blocks, float(s), len(white)) for s in noises], axis=0)
    chance = np.exp(logs - logs.max())
    own = np.split(chance / chance.sum(), [len(units), len(units) + 1])
    return ChangeProbabilities(own[0], float(own[1][0]), own[2])


def _log_densities(gram: Array, blocks: Sequence[Block], noise: float, count: int) -> Array:
    """Return the log densities (k,) of ``count`` white readings by each cause, with noise so many times as large."""
    alone = ConditionalProducts.of(gram / noise**2, [])
    none = -0.5 * float(alone.gram[-1, -1]) - count * np.log(noise)
    return np.array([none + np.logaddexp.reduce(alone.gains(b)) for b in blocks])


ChangeKind = Literal["zero", "gear", "fixture", "tool", "collision"]


@dataclass(frozen=True)
class Change:
    """One thing that may have changed.

    Attributes:
        kind, name: what, in words.
        parameters: by which it changes readings, d of them.
        square: mean square motion of the tool over the workspace per squared parameters, (d, d) [m² per unit²]; of a
            fixture its own.
        advice: what a person does about it.
    """

    kind: ChangeKind
    name: str
    parameters: tuple[Parameter, ...]
    square: Array
    advice: str


def possible_changes(cell: Cell, setup: MeasurementSetup, with_play: bool) -> tuple[Change, ...]:
    """Return all that a check looks for.

    Args:
        cell, setup: that are checked.
        with_play: whether the directions are known from which the joints came to the poses.
    """
    bare = list(_bare_changes(setup, with_play))
    q = uniform_states(cell, 400, 0)  # of the workspace, over which the motion of the tool is taken
    sides = np.random.default_rng(1).choice(np.array([-1.0, 1.0]), size=q.shape)
    samples = Samples(q, np.zeros(len(q), dtype=int), direction=sides)
    own = _by_change(tool_rows(samples, setup, _numbered_parameters(bare))[2], bare)
    moved = zip(bare, own, strict=True)
    return tuple(c if c.kind == "fixture" else replace(c, square=m.T @ m / len(q)) for c, m in moved)


def change_columns(baseline: Baseline, samples: Samples, changes: Sequence[Change]) -> tuple[Array, ...]:
    """Return the effect of every change on the readings, (n, d) [m per unit] each."""
    return _by_change(baseline.rows(samples, _numbered_parameters(changes)), changes)


def _numbered_parameters(changes: Sequence[Change]) -> list[Parameter]:
    """Parameters of all changes, each with a name of its own."""
    return [replace(p, name=f"{k}, {p.name}") for k, c in enumerate(changes) for p in c.parameters]


def _by_change(rows: Array, changes: Sequence[Change]) -> tuple[Array, ...]:
    """Split the last columns of rows (n, P), those of the changes, into one block a change."""
    ends = np.cumsum([len(c.parameters) for c in changes])
    return tuple(np.split(rows[:, -ends[-1] :], ends[:-1], axis=1))


def _bare_changes(setup: MeasurementSetup, with_play: bool) -> Iterator[Change]:
    """Yield the changes, the square of each still the identity: right for fixtures, replaced for the others."""
    rotation = {t.joint: k for k, t in enumerate(setup.chain.transforms) if t.joint is not None}
    slides = setup.robot.slides
    zeros = tuple(_parameter(rotation[j], f"zero{j + 1}", unit="m" if slides[j] else "rad") for j in sorted(rotation))
    for j, p in enumerate(zeros, 1):
        yield _change("zero", f"zero of joint {j}", (p,), f"master axis {j} and check again")
    for j in (j for j in sorted(rotation) if not slides[j]):
        phis: list[BasisFunction] = [JointWave(w, j, 1.0) for w in WAVES]
        phis += [ApproachDirection(j)] if with_play else []
        parameters = tuple(_parameter(rotation[j], f"gear{j + 1}_{k}", phi) for k, phi in enumerate(phis))
        advice = f"call service: gear or bearing of axis {j + 1}"
        yield _change("gear", f"gear of joint {j + 1}", parameters, advice)
    tool = tuple(_parameter(setup.chain.index(f"map_{a}"), f"tool_{a}", unit="m") for a in "xyz")
    yield _change("tool", "tool", tool, "check the tool flange and the seat of the ball on the tool, then check again")
    fixtures = Model.of(setup, frozenset({"fixture"})).parameters
    for name in setup.place_names:
        label = f"fixture {name}".rstrip()
        names = {f"{label.replace(' ', '_')}_{a}" for a in "xyz"}
        if own := tuple(p for p in fixtures if p.name in names):
            advice = f"check that {label} stands fast and its cup is clean, then check again"
            yield _change("fixture", label, own, advice)
    hit = (*zeros, *tool)
    yield _change("collision", "several axes and the tool", hit, "something was hit or moved: calibrate again")


def _change(kind: ChangeKind, name: str, parameters: tuple[Parameter, ...], advice: str) -> Change:
    return Change(kind, name, parameters, np.eye(len(parameters)), advice)


def _parameter(transform: int, name: str, phi: BasisFunction = ONE, unit: str = "rad") -> Parameter:
    return Parameter(name, unit, 1.0, name, transform_move(transform, phi), "change")


Outcome = Literal["unchanged", "changed within the limit", "changed"]
ANYTHING = "something else, or several things at once"


@dataclass(frozen=True)
class JudgedChange:
    """One possible change, as the readings have it.

    Attributes:
        change: what; test: how well it explains the readings; probability: that it was this, if anything has changed.
        motion, motion_std: rms of the tool over the workspace that it would mean, and its standard deviation [m].
        values: of its parameters, (d,).
        detectable: least motion of the tool that the check finds nine times of ten, whatever its way [m].
    """

    change: Change
    test: Explanation
    probability: float
    motion: float
    motion_std: float
    values: Array
    detectable: float


@dataclass(frozen=True)
class CheckVerdict:
    """What a check says.

    Attributes:
        run: its name; poses: ids, (n,); difference: readings less expectation, what is set up anew for a session
            taken off, (n, r) [m, rad]; std: expected, (n, r) [m, rad].
        judged: every possible change, the likeliest first.
        anything: test for any change at all; nameless: probability that it was none of those.
        threshold: probability below which any of the tests gives an alarm.
        limit: of the tool's motion [m] that the user allows; ``None``: any change fails.
        notes: what a person should know.
    """

    run: str
    poses: np.ndarray
    difference: Array
    std: Array
    judged: tuple[JudgedChange, ...]
    anything: Explanation
    nameless: float
    threshold: float
    limit: float | None
    notes: tuple[str, ...]
    doubtful: str = ""

    @property
    def smallest_p(self) -> float:
        """The smallest probability of all tests."""
        return min(self.anything.p_value, *(j.test.p_value for j in self.judged))

    @property
    def likeliest_change(self) -> JudgedChange | None:
        """The most likely change; ``None`` where something without a name, or several at once, is likelier."""
        return self.judged[0] if self.judged[0].probability >= self.nameless else None

    @property
    def rivals(self) -> tuple[JudgedChange, ...]:
        """Other changes that it may have been, as likely as rivals of a finding are at least."""
        if self.likeliest_change is None:
            return ()
        return tuple(j for j in self.judged[1:] if j.probability >= HUNDRED_TO_ONE)

    @property
    def outcome(self) -> Outcome:
        """The outcome: unchanged, changed within the limit, or changed."""
        if self.smallest_p >= self.threshold:
            return "unchanged"
        each = (self.likeliest_change, *self.rivals) if self.likeliest_change else ()
        # a change may be two sigmas larger than its estimate: so far it must stay below the limit
        small = self.limit is not None and all(j.motion + 2.0 * j.motion_std <= self.limit for j in each)
        return "changed within the limit" if small and each else "changed"

    @property
    def passed(self) -> bool:
        """Whether the robot may go on."""
        return self.outcome != "changed"

    @property
    def advice(self) -> str:
        """Return what a person does next."""
        if self.outcome == "unchanged":
            return "go on: no change that these poses can tell"
        if self.outcome == "changed within the limit":
            return "go on, and check again soon: the change is within the limit"
        if self.doubtful:
            return f"read again {self.doubtful}: that one reading alone would explain it; then judge the check again"
        return "calibrate again" if self.likeliest_change is None else self.likeliest_change.change.advice


def evaluate_check(baseline: Baseline, cell: Cell, run: Run, limit: float | None = None) -> CheckVerdict:
    """Test the run of a check against the baseline.

    Args:
        baseline: of the robot.
        cell: that was calibrated.
        run: a few poses at rest, measured with the gauge of the baseline.
        limit: motion of the tool that is allowed [m].

    Raises:
        InputError: the run is of another robot, gauge or fixture, was driven in motion, or is too short.
    """
    run = _prepare(run, cell, baseline)
    samples, known = run.samples, baseline.adapt_to_session(cell, run)
    every = possible_changes(cell, known.model.setup, shows_play(samples))
    detector, changes, hidden = build_detector(known, every, samples)
    difference = known.difference(run)
    *tests, anything = detector.explain(difference)
    units = [1 / np.sqrt(np.diag(c.square)) for c in changes]
    likely = weigh_changes(detector, units, difference, len(samples))
    each = zip(changes, tests, likely.changes.tolist(), strict=True)
    judged = [_judge(detector, c, e, p, difference) for c, e, p in each]
    left = len(baseline.values) - len(baseline.restrict_to_samples(samples).values)
    notes = [f"{left} effects of the baseline need quantities that the run does not hold: left out"] if left else []
    notes += [hidden_changes_text(hidden)] if hidden else []
    verdict = CheckVerdict(
        run=run.name,
        poses=np.arange(len(samples)) if samples.pose is None else samples.pose,
        difference=difference.reshape(len(samples), -1),
        std=detector.std.reshape(len(samples), -1),
        judged=tuple(sorted(judged, key=lambda j: -j.probability)),
        anything=anything,
        nameless=likely.anything,
        threshold=detector.threshold,
        limit=limit,
        notes=(*run.warnings, *notes),
    )
    wrong = None if verdict.passed else likely.wrong_reading
    return verdict if wrong is None else replace(verdict, doubtful=run.where_at_pose(wrong))


def shows_play(samples: Samples) -> bool:
    """Tell whether some joint came to the poses from both sides, so that its play can show."""
    return samples.direction is not None and bool((np.ptp(samples.direction, axis=0) > 1.0).any())


def build_detector(
    baseline: Baseline, changes: tuple[Change, ...], samples: Samples
) -> tuple[Detector, tuple[Change, ...], tuple[Change, ...]]:
    """Return the tests for changes in readings of some samples, the changes that show there, and those that do not."""
    columns = change_columns(baseline, samples, changes)
    anew = baseline.anew_rows(samples)
    detector = Detector(baseline.covariance(samples), columns, baseline.file.freedom, anew)
    shown, hidden = (tuple(c for c, s in zip(changes, detector.shows, strict=True) if s == v) for v in (True, False))
    kept = tuple(c for c, s in zip(columns, detector.shows, strict=True) if s)
    return replace(detector, columns=kept), shown, hidden


def hidden_changes_text(hidden: tuple[Change, ...]) -> str:
    """Say which changes no reading shows, and why."""
    names = " and ".join(c.name for c in hidden)
    return (
        f"no reading shows the {names}: what is set up anew for every session (frame or zero of the gauge) takes it up"
    )


def _judge(
    detector: Detector, change: Change, test: Explanation, probability: float, difference: Array
) -> JudgedChange:
    values, covariance = detector.estimate(test.which, 1 / np.sqrt(np.diag(change.square)), difference)
    motion = float(np.sqrt(values @ change.square @ values))
    slope = change.square @ values / max(motion, 1e-12)
    std = float(np.sqrt(slope @ covariance @ slope))
    return JudgedChange(
        change, test, probability, motion, std, values, detector.detectable_motion(test.which, change.square)
    )


def _prepare(run: Run, cell: Cell, baseline: Baseline) -> Run:
    """Return the run with places and points numbered as in the baseline, and readings as the baseline has them."""
    cell.gauge.check_run(cell, run)
    if run.robot is not None and run.robot != cell.robot.name:
        raise InputError(f"{run.name}: was measured on '{run.robot}', but the baseline is of '{cell.robot.name}'")
    if run.continuous:
        raise InputError(f"{run.name}: was measured while moving; a check is measured at rest, as its plan drives it")
    if len(run) < FEWEST_READINGS:
        raise InputError(
            f"{run.name}: {number_of(len(run), 'pose')}; a check needs {FEWEST_READINGS} at least, better the ten of "
            "its plan"
        )
    if baseline.file.turns and run.readings.rotation is None and run.readings.pixels is None:
        raise InputError(f"{run.name}: has no rx_deg, ry_deg, rz_deg, but the baseline was measured with orientations")
    readings = run.readings if baseline.file.turns else replace(run.readings, rotation=None)
    run = add_motion(run)
    place = _renumber(run, run.samples.place, run.places, tuple(baseline.file.fixtures) or run.places, "fixture")
    point = _renumber(run, run.samples.point_numbers, run.points, baseline.model.setup.point_names, "tool point")
    return replace(run, samples=replace(run.samples, place=place, point=point), readings=readings)


def _renumber(run: Run, which: np.ndarray, names: tuple[str, ...], known: tuple[str, ...], what: str) -> np.ndarray:
    if len(known) == 1 and len(names) == 1:
        return np.zeros(len(which), dtype=int)
    strange = [n for n in names if n not in known]
    if strange:
        raise InputError(f"{run.name}: the {what} '{strange[0]}' is not in the baseline (there: {', '.join(known)})")
    return np.asarray(np.array([known.index(n) for n in names])[which])
