"""Draws candidates until there are enough, and counts what every filter leaves."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, fields
from typing import ClassVar, Self

import numpy as np

from planner.cell.cell import Cell
from planner.cell.gauge_types import JointSamples
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import UNLIMITED, LastStart, StageProgress, TimeLimit
from planner.common.second_process import available_threads
from planner.common.units import Array, to_mm
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import Mounting, Samples

MOST_ROUNDS = 80  # of 20 million samples together: then nothing more is drawn
DRAWS = (1 << 14, 1 << 18)  # samples of the other joints in the first round, and at most: each doubles the last


@dataclass(frozen=True)
class Funnel:
    """Counts that survive each filter, in order."""

    sampled: int = 0
    joint_limits: int = 0
    workspace: int = 0
    cones: int = 0
    cable: int = 0
    collision: int = 0

    names: ClassVar[tuple[str, ...]] = (
        "sampled",
        "within joint limits",
        "in the gauge's range",
        "within its cones",
        "within the cable",
        "collision-free",
    )

    def __add__(self, other: Self) -> Self:
        """Add two funnels filter by filter."""
        return type(self)(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def text(self) -> str:
        """Return the counts as a person reads them."""
        return ", ".join(f"{n} {name}" for n, name in zip(astuple(self), self.names, strict=True))


@dataclass(frozen=True)
class PoseSet:
    """Poses that pass every filter.

    Attributes:
        samples: controller angles, and how the gauge is held there.
        funnel: what each filter left.
        ball: at which ball, (n,) int, where an artifact's balls are measured.
        back: the pose from which each is approached, (n, N) [rad], there too.
    """

    samples: Samples
    funnel: Funnel
    ball: np.ndarray | None = None
    back: Array | None = None

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.samples)

    @property
    def q(self) -> Array:
        """Controller angles, (n, N) [rad]."""
        return self.samples.q

    def take(self, rows: np.ndarray) -> "PoseSet":
        """Return the poses at ``rows`` (positions or a mask), with the same funnel."""
        ball, back = (None if v is None else v[rows] for v in (self.ball, self.back))
        return PoseSet(self.samples.take(rows), self.funnel, ball, back)


def draw_candidates(
    cell: Cell, count: int, seed: int = 0, progress: StageProgress | None = None, limit: TimeLimit = UNLIMITED
) -> PoseSet:
    """Draw ``count`` candidates, shared evenly by the fixtures and tool points, or what the rounds allow.

    Args:
        cell: the cell; its ``plan.grid_step`` asks for the paper's joint grid instead of the shell's own samples.
        count: how many are wanted.
        seed: of the low-discrepancy sequence.
        progress: called with (found, wanted).
        limit: of the time that a plan may take.

    Raises:
        NoSolutionError: no state passes all filters; the message names the filter that emptied, and what would help.
    """
    share = -(-count // len(cell.mountings))
    parts: list[Samples] = []
    funnel = Funnel()
    for mounting in cell.mountings:
        q, counted = _draw_at(cell, mounting, share, seed, progress, limit)
        funnel += counted
        if len(q) == 0:
            raise NoSolutionError(explain_empty(cell, mounting, counted))
        parts.append(Samples.at(q, mounting))
    return PoseSet(Samples.concatenate(parts), funnel)


def _draw_at(
    cell: Cell, mounting: Mounting, count: int, seed: int, progress: StageProgress | None, limit: TimeLimit
) -> tuple[Array, Funnel]:
    world, workspace = CollisionWorld.from_cell(cell, mounting), Workspace(cell, mounting)
    found: list[Array] = []
    funnel, total = Funnel(), 0
    whole = cell.plan.grid_step is not None
    for sample in _sample_rounds(cell, mounting, seed):
        q, counted = _apply_filters(sample, workspace, world, None if whole else count - total)
        funnel, total = funnel + counted, total + len(q)
        found.append(q)
        if progress is not None:
            progress(min(total, count), count)
        none_is_read = 2_000_000  # states that read no length or leave the cones, after which no more are drawn
        out_of_reach = funnel.workspace == 0 and funnel.sampled > none_is_read and not whole
        closed = funnel.cable == 0 and funnel.workspace > none_is_read and not whole
        none_is_free = 50_000  # states that all collide, after which no more are drawn
        nowhere = funnel.cable > none_is_free or out_of_reach or closed
        many = 5_000  # states that all collide, after which it is asked whether one pair of bodies is why
        hopeless = total == 0 and (nowhere or (funnel.cable > many and _is_one_pair_near(world, workspace, sample)))
        if (total >= count and not whole) or hopeless:
            break
        if limit.must_stop(
            LastStart.CANDIDATES if total else LastStart.ROADMAP,
            f"{min(total, count)} of {count} candidates were drawn",
        ):
            break
    q = np.vstack(found)
    if whole and len(q) > count:  # a grid is thinned evenly, not cut off
        q = q[np.linspace(0, len(q) - 1, count).astype(int)]
    return q[:count], funnel


def _is_one_pair_near(world: CollisionWorld, workspace: Workspace, sample: JointSamples) -> bool:
    """Tell whether the same two bodies are too near in every state of a sample that passes all other filters."""
    few = 100  # states by which pairs are singled out; that many say nothing of all
    q, _ = _apply_workspace_filters(sample.q, workspace)
    wanted = world.cell.motion.clearance + SAFETY_MARGIN
    likely = np.flatnonzero((world.distances(q[:few]) < wanted).all(axis=0))
    rows, columns = np.divmod(np.arange(len(q) * len(likely)), max(len(likely), 1))
    near = world.pair_distances(q, rows, likely[columns]).reshape(len(q), len(likely)) < wanted
    return len(q) > few and bool(near.all(axis=0).any())


def _sample_rounds(cell: Cell, mounting: Mounting, seed: int) -> Iterator[JointSamples]:
    if cell.plan.grid_step is not None:
        yield from _grid_blocks(cell, cell.plan.grid_step)
        return
    draw = cell.gauge.joint_sampler(cell, mounting, seed)
    for k in range(MOST_ROUNDS):
        yield draw(min(DRAWS[0] << k, DRAWS[1]))


def _grid_blocks(cell: Cell, step: float) -> Iterator[JointSamples]:
    """Yield the states of the equidistant joint grid with ``step`` [rad], centred in each joint's range, in blocks.

    Raises:
        InputError: the grid has more states than can be visited.
    """
    most_states = 200_000_000  # states that can be visited in a tolerable time
    block = 1 << 18  # states at a time: 12 MB of joint angles
    lower, upper = cell.sampling_range
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int) + 1, 1)
    total = int(np.prod(counts.astype(object)))
    if total > most_states:
        raise InputError(
            f"plan.grid_step_deg = {np.rad2deg(step):g} gives {total:.3g} joint states; at most {most_states:.3g} can"
            " be visited: take a wider step"
        )
    origin = (lower + upper) / 2 - (counts - 1) * step / 2
    for start in range(0, total, block):
        index = np.unravel_index(np.arange(start, min(start + block, total)), tuple(counts))
        q: Array = origin + np.stack(index, axis=1) * step
        yield JointSamples(q, len(q))


def _apply_filters(
    sample: JointSamples, workspace: Workspace, world: CollisionWorld, wanted: int | None
) -> tuple[Array, Funnel]:
    """Apply the filters to blocks of samples until ``wanted`` states have passed, or to all of them."""
    block_size = 65_536  # states that pass the filters before it is seen whether there are enough
    if not len(sample.q):  # none of what was drawn reads a length: it counts all the same
        return sample.q, Funnel(sample.stands_for, sample.stands_for)
    found: list[Array] = [sample.q[:0]]
    funnel, left = Funnel(), sample
    while len(left.q) and (wanted is None or funnel.collision < wanted):
        share = min(1.0, block_size / len(left.q))
        stands_for = round(left.stands_for * share)
        block, left = (
            JointSamples(left.q[:block_size], stands_for),
            JointSamples(left.q[block_size:], left.stands_for - stands_for),
        )
        q, counted = _filter_block(block, workspace, world)
        found.append(q)
        funnel += counted
    return np.vstack(found), funnel


def _filter_block(sample: JointSamples, workspace: Workspace, world: CollisionWorld) -> tuple[Array, Funnel]:
    """Apply the filters in order, the cheap ones first and in threads (numpy lets them run side by side)."""
    chunk = 8192  # states that a thread filters: they stay in the processor's cache
    chunks = [sample.q[i : i + chunk] for i in range(0, len(sample.q), chunk)]
    with ThreadPoolExecutor(available_threads()) as threads:
        results = list(threads.map(lambda q: _apply_workspace_filters(q, workspace), chunks))
    q = np.vstack([r[0] for r in results])
    free = q[~world.collides(q, world.cell.motion.clearance + SAFETY_MARGIN)]
    # states that the arcs never visited passed the joint limits as well
    outside = sample.stands_for - len(sample.q)
    within, shell, cones, cable = (int(c) for c in np.sum([r[1] for r in results], axis=0))
    return free, Funnel(sample.stands_for, within + outside, shell, cones, cable, len(free))


def _apply_workspace_filters(q: Array, workspace: Workspace) -> tuple[Array, list[int]]:
    left = workspace.positions_within_margins(q, SAFETY_MARGIN)
    return q[left[-1]], [len(each) for each in left]


def explain_empty(cell: Cell, mounting: Mounting, funnel: Funnel) -> str:
    """Say which filter emptied the candidates, with counts, and what would help."""
    name = cell.place_name(mounting)
    where = f"fixture {name}" if name else f"the {cell.gauge.noun}"
    head = f"no candidate pose is left for {where}: {funnel.text()}."
    if funnel.workspace == 0:
        return f"{head} {_explain_out_of_reach(cell, mounting)}"
    if funnel.cones == 0:
        turn = f"turn fixtures.axis or tool.map_axis towards the {cell.gauge.noun}, or widen gauge.cone_deg"
        return f"{head} The ball joints' cones reject all: {turn}."
    if funnel.cable == 0:
        return f"{head} The cable's budget rejects all: raise cable limits, or choose a home that is less twisted."
    near = _nearest_pairs(cell, mounting)
    wanted = to_mm(cell.motion.clearance + SAFETY_MARGIN)
    why = f"Every state collides (nearer than {wanted:g} mm)"
    return f"{head} {why}: {near}; look at motion.clearance_mm and at these bodies."


def explain_few(cell: Cell, funnel: Funnel) -> str:
    """Say what would give more candidates: a larger number, or what widens the filter that left the smallest share."""
    if funnel.collision >= cell.plan.candidates or not funnel.workspace:
        return "raise plan.candidates"
    advice = {
        "cones": f"turn fixtures.axis or tool.map_axis towards the {cell.gauge.noun}, or widen gauge.cone_deg",
        "cable": "raise the limits of [cable], or choose a home that is less twisted",
        "collision": "look at motion.clearance_mm, and at what stands about the fixture",
    }
    keys, counts = [f.name for f in fields(Funnel)], astuple(funnel)
    tried = [k for k, key in enumerate(keys) if key in advice and counts[k - 1]]
    worst = min(tried, key=lambda k: counts[k] / counts[k - 1])
    left = f"{counts[worst]} of {counts[worst - 1]} states {funnel.names[worst - 1]} are {funnel.names[worst]}"
    return f"{left}: {advice[keys[worst]]}"


def _nearest_pairs(cell: Cell, mounting: Mounting) -> str:
    """Say which pairs of bodies are too near most often in states that pass all other filters, and how often."""
    world, workspace = CollisionWorld.from_cell(cell, mounting), Workspace(cell, mounting)
    q, _ = _apply_workspace_filters(cell.gauge.joint_sampler(cell, mounting, 0)(DRAWS[0]).q, workspace)
    if not len(q):
        return "too few of them were drawn to say what with"
    wanted = cell.motion.clearance + SAFETY_MARGIN  # as the filter has it: a pair may always stand between the two
    share = (world.distances(q[:300]) < wanted).mean(axis=0)  # 300 states say what collides
    worst = np.argsort(-share, kind="stable")[:4]  # as many pairs of bodies as a message can hold
    return ", ".join(
        f"{world.scene.describe_pair(int(k))} in {share[k]:.0%} of the states" for k in worst if share[k] > 0
    )


def _explain_out_of_reach(cell: Cell, mounting: Mounting) -> str:
    """Say how far the fixture is out of reach and which way to move it."""
    cell, rng = cell.at(mounting), np.random.default_rng(0)
    q = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (200_000, cell.robot.n_joints))
    x, f = cell.map_position(q), cell.fixtures[mounting.fixture].p_BX
    distance = np.linalg.norm(x - f, axis=1)
    k = int(np.argmin(distance))
    if distance[k] > cell.gauge.length_max:
        gap = distance[k] - cell.gauge.length_max
        move = (x[k] - f) / distance[k] * gap * 1e3
        return (
            f"The fixture is about {gap * 1e3:.0f} mm out of reach of the longest {cell.gauge.noun}: "
            f"move it by about [{move[0]:.0f}, {move[1]:.0f}, {move[2]:.0f}] mm, or take a longer {cell.gauge.noun}."
        )
    return f"The {cell.gauge.noun}'s range and the reachable distances do not meet: check gauge.length_mm."
