"""One blind trial: a run is made, the identifier gets its files alone, and its findings are held against the truth."""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.documents.calibration import Calibration
from planner.fit.cross_validation import split_run
from planner.identification.pipeline import FitSettings, identify
from planner.inference.stages import Tracer
from planner.runs.loader import load_runs
from planner.runs.run import Run
from planner.tracing.trace import trace
from tests.effects.catalogue.naming import joint_of, named
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.draw import USUAL, as_in_a_real_arm, random_run
from tests.simulation.generator.made import Made
from tests.simulation.generator.sizing import Implausible
from tests.simulation.generator.truth import Noise, draw_truth

NOISES = {"white": USUAL, "heavy": Noise(shape="heavy"), "correlated": Noise(shape="correlated")}
UNNAMED = "unnamed"
BUILDS = {"edbb": runs.edbb_static, "moving": runs.edbb_continuous, "tracker": runs.tracker, "balls": runs.balls}


@dataclass(frozen=True)
class Task:
    """What to make: ``part`` of the table, gauge, arm, kind (empty: none, ``arm``: as in a real arm), share, noise."""

    part: str
    gauge: str
    arm: str
    kind: str
    share: float
    noise: str
    seed: int


@dataclass(frozen=True)
class Planted:
    """An effect as it was planted, and whether it was named, alone or beside its rivals."""

    kind: str
    joint: int
    share: float
    size: float
    inner: tuple[tuple[str, float], ...]
    named: bool
    as_rival: bool


@dataclass(frozen=True)
class Named:
    """A finding, and whether it names something that was planted."""

    effect: str
    on: str
    rivals: tuple[str, ...]
    right: bool
    note: str
    log_p: float


@dataclass(frozen=True)
class Outcome:
    """What came of a task; errors in metres, ``seconds`` of tracing and fitting; ``failed``: why nothing came."""

    task: Task
    planted: tuple[Planted, ...] = ()
    named: tuple[Named, ...] = ()
    rejected: tuple[tuple[str, str], ...] = ()
    held_out: float = 0.0
    geometry: float = 0.0
    oracle: float = 0.0
    oracle_geometry: float = 0.0
    seconds: float = 0.0
    failed: str = ""

    @property
    def all_named(self) -> bool:
        """Whether everything planted was named."""
        return all(p.named or p.as_rival for p in self.planted)

    @property
    def invented(self) -> int:
        """How many names stand for nothing that was planted; what is called unnamed is no name."""
        return sum(not n.right and n.effect != UNNAMED for n in self.named)


def made(task: Task) -> Made:
    """Make the run of a task.

    Raises:
        Implausible: the share would need an effect larger than any real arm has.
    """
    arm, build, noise = Arm.from_toml(task.arm), BUILDS[task.gauge], NOISES[task.noise]
    if task.kind == "arm":
        return as_in_a_real_arm(build, arm, task.seed, task.share, noise)
    if not task.kind:
        return build(arm, seed=task.seed, truth=draw_truth(arm, task.seed, (), noise, 0.15))
    return random_run(build, arm, task.seed, [task.kind], task.share, noise=noise, mass_spread=0.15)


def identified(made: Made, tracer: Tracer, settings: FitSettings | None = None) -> tuple[Run, Calibration, float]:
    """Give the identifier the files of a run alone; return the run as read, what was found, and the seconds it took."""
    with tempfile.TemporaryDirectory() as folder:
        files = made.write(Path(folder))
        cell = load_cell(str(files[1]), planning=False)
        run = load_runs([files[0]], cell.robot.n_joints)
        start = time.process_time()
        found = identify(run, cell, settings=settings, tracer=tracer)
        return run, found, time.process_time() - start


def tried(task: Task, settings: FitSettings | None = None) -> Outcome:
    """Make the run, identify it blindly, and judge."""
    try:
        run = made(task)
    except Implausible as no:
        return Outcome(task, failed=f"not made: {no}")
    measured, found, spent = identified(run, trace, settings)
    assert found.tried is not None
    names = [(f.effect, f.on, f.rivals, f.note, f.log_p) for c in found.findings for f in c.each]
    effects = run.truth.effects
    planted = tuple(_planted(run, e, [(f"{k}, {on}", rivals) for k, on, rivals, _, _ in names]) for e in effects)
    given = tuple(
        Named(k, on, rivals, any(right(e, n) for e in effects for n in (f"{k}, {on}", *rivals)), note, p)
        for k, on, rivals, note, p in names
    )
    folds = split_run(measured).fold[run.rows]
    return Outcome(
        task,
        planted,
        given,
        tuple((r.name, r.because) for r in found.rejected),
        found.stages[-1].held_out.rms,
        next(s for s in found.stages if s.name == "geometry").held_out.rms,
        run.oracle(folds)[1],
        run.oracle(folds, knows_effects=False)[1],
        spent,
    )


def right(effect, name: str) -> bool:
    """Whether a name such as ``gear ripple, joint 3`` names the effect rightly."""
    label, on = name.split(", ", 1)
    if label == UNNAMED:  # a description, right where it says what is moved by what
        return effect.kind == "hose-drag" and on == f"joint {effect.joint} by joint {effect['by']:.0f}"
    if effect.kind == "coupling":
        return (label, on) == named(effect)
    return catalogue.KINDS[effect.kind].counts_as_right(effect, label, joint_of(on))


def _planted(run: Made, effect, names: list[tuple[str, tuple[str, ...]]]) -> Planted:
    return Planted(
        effect.kind,
        effect.joint,
        run.share_of(effect),
        effect.size,
        effect.inner,
        any(right(effect, name) for name, _ in names),
        any(right(effect, r) for _, rivals in names for r in rivals),
    )
