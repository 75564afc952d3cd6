"""One fit of poses without load and of loaded circles: its rows, what it would know, and the circles that add most.

Circles under load chosen beside poses without load: those that one fit of both gains most from, and their plan.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.cell.reading import load_cell
from planner.circular.plan import Circle, CircularPlan, circles_of
from planner.circular.planning import plan_arc, plan_circles
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages
from planner.common.units import Array, from_deg, read_only
from planner.design.observability.information import marginal_information, predict_covariance
from planner.design.selection.d_optimal import augment_design
from planner.effects.compliance import compliance_parameters, is_joint_compliance
from planner.loaded.assumptions import DRIVABLE
from planner.loaded.circle_candidates import FOLLOWED_ANGLES, CirclePlace, planned_curves, with_circles
from planner.loaded.joint_fit import torque_rows, whiten_turns
from planner.model.model import Model
from planner.motion.path.constraints import Constraints
from planner.runs.run import Samples
from planner.session.document import read_plan
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.simulation.equilibrium import solve_equilibrium, use_held_torques

FITTED = ("calibrate", "repeat")  # roles of the poses that a fit sees


@dataclass(frozen=True)
class FitRows:
    """Rows (n, P) of one kind of run in standard deviations of a reading, with names, units and prior sigmas.

    What belongs to one gauge alone, its fixtures and zero, is named after it.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    prior: Array
    rows: Array

    def on(self, names: Sequence[str]) -> Array:
        """Rows per prior sigma with the columns of ``names``, (n, len(names)); nought where it has none of them."""
        out = np.zeros((len(self.rows), len(names)))
        here = [n for n in self.names if n in names]
        which = [self.names.index(n) for n in here]
        out[:, [list(names).index(n) for n in here]] = self.rows[:, which] * self.prior[which]
        return out


@dataclass(frozen=True)
class UnloadedPoses:
    """Poses of a bar without load: its cell, the controller angles, and how the bar is held at each."""

    cell: Cell
    samples: Samples

    @classmethod
    def of(cls, plan: Plan) -> "UnloadedPoses":
        """Return the poses of a plan that the fit uses; mounting and validation poses are left out."""
        visits = [v for d in plan.drives for v in d.visits if v.role in FITTED]
        return cls(plan.cell, Samples.concatenate([Samples.at(v.q[None], v.mounting) for v in visits]))

    @classmethod
    def read(cls, plan: Path) -> "UnloadedPoses":
        """Read the same from the file of a plan.

        Raises:
            InputError: the plan or its cell.toml is wrong, or they do not belong together.
        """
        poses = [p for p in read_plan(plan).poses if p.role in FITTED]
        if not poses:
            raise InputError(f"{plan}: has no poses to calibrate by; a plan of a bar without load is needed here")
        cell = load_cell(str(plan.parent / "cell.toml"))
        held = zip(poses, cell.mountings_of(poses, plan), strict=True)
        return cls(cell, Samples.concatenate([Samples.at(from_deg([p.q_deg]), m) for p, m in held]))


def unloaded_rows(free: UnloadedPoses) -> FitRows:
    """Return the rows of poses without load."""
    setup = setup_of(free.cell)
    model = Model.of(setup, free.cell.plan.free).plus(compliance_parameters(setup))
    rows = model.rows(free.samples)[:, 0] / model.noise(free.samples)[:, None]
    return _name_rows(model, rows, "unloaded ", True)


def loaded_rows(cell: Cell, places: Sequence[CirclePlace], shared_tool: bool) -> FitRows:
    """Return the rows of loaded circles, every angle, load and sense; places are named P1 … in the order given."""
    setup = setup_of(cell)
    names = tuple(f"P{k + 1}" for k in range(len(places)))
    p_BX, prior = np.array([p.p_BX for p in places]), np.repeat(setup.place_prior[:1], len(places))
    setup = replace(setup, p_BX=p_BX, place_names=names, place_prior=prior)
    model = Model.of(setup, cell.plan.free).plus(compliance_parameters(setup))
    rows = np.concatenate([_circle_rows(model, k, c) for k, c in enumerate(places)])
    return _name_rows(model, rows, "loaded ", shared_tool)


def _name_rows(model: Model, rows: Array, whose: str, shared_tool: bool) -> FitRows:
    def name(plain: str, group: str) -> str:
        """Return a parameter's name in the common fit, in which each run has the parameters of its own gauge."""
        return f"{whose}{plain}" if group == "gauge" and not (shared_tool and plain.startswith("map_")) else plain

    names = tuple(name(p.name, p.group) for p in model.parameters)
    return FitRows(names, tuple(p.unit for p in model.parameters), model.prior, rows)


def _circle_rows(model: Model, k: int, place: CirclePlace) -> Array:
    """Rows (n, P) of one circle, every load and sense, in standard deviations; the k-th of the model's places.

    They are those of the common fit, about joints that yield as is typical: the fixture's place turns the load, and
    what all loads have in common carries the error of a pose.
    """
    curves = planned_curves(model.setup, place)
    D, K, A = curves.length.shape
    apart = np.fft.irfft(curves.noise, A)[(np.arange(A)[:, None] - np.arange(A)) % A]
    samples = Samples(curves.q.reshape(D * K * A, -1), np.full(D * K * A, k), force=curves.force.ravel())
    soft = np.array([is_joint_compliance(p) for p in model.parameters])
    held = replace(model, parameters=use_held_torques(model.parameters))
    errors = np.where(soft, DRIVABLE.typical_compliance_share * model.prior, 0.0)
    there = solve_equilibrium(model, samples, errors)[1]
    rows = held.rows(there, errors)[:, 0] + torque_rows(held, there, errors, model.prior)
    pose = model.noise(samples) ** 2
    parts = zip(range(D), np.split(rows, D), np.split(pose, D), strict=True)
    return np.concatenate([whiten_turns(r, apart / curves.repeats[d, :, None, None], v) for d, r, v in parts])


@dataclass(frozen=True)
class CommonFit:
    """Standard deviations per prior sigma, (P,) each, of geometry and compliances.

    ``unloaded``, ``loaded``: by one kind of run alone; ``both``: by one fit of all. ``prior`` sizes in ``units``.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    prior: Array
    unloaded: Array
    loaded: Array
    both: Array

    @property
    def parts(self) -> dict[str, Array]:
        """The standard deviations by name of what is known."""
        return {"unloaded": self.unloaded, "loaded": self.loaded, "together": self.both}

    def of(self, start: str) -> tuple[tuple[str, float, float, float], ...]:
        """Rows (name, unloaded, loaded, both) of the parameters whose names begin so."""
        rows = zip(self.names, *(part.tolist() for part in self.parts.values()), strict=True)
        return tuple(row for row in rows if row[0].startswith(start))


def predict_common_fit(free: UnloadedPoses, cell: Cell, places: Sequence[CirclePlace]) -> CommonFit:
    """Predict what unloaded poses and loaded circles know, each alone and together.

    Each gauge has its own fixtures and zero; the tool point is common where both cells have the same, geometry and
    compliances are.

    Args:
        free: the poses without load.
        cell: with the loaded circle; places: where it is driven.

    Raises:
        InputError: the cells have different robots.
    """
    check_robots(free.cell, cell)
    first = unloaded_rows(free)
    second = loaded_rows(cell, places, has_same_tool(free.cell, cell))
    names = (*first.names, *(n for n in second.names if n not in first.names))
    common = [k for k, n in enumerate(names) if n in first.names and n in second.names]
    one, other = first.on(names), second.on(names)
    size = np.ones(len(names))
    known = [predict_covariance(rows, 1.0, size).std for rows in (one, other, np.concatenate([one, other]))]
    where = [first.names.index(names[k]) for k in common]
    return CommonFit(
        tuple(names[k] for k in common),
        tuple(first.units[k] for k in where),
        read_only(first.prior[where]),
        *(read_only(s[common]) for s in known),
    )


def check_robots(free_cell: Cell, cell: Cell) -> None:
    """Refuse two cells with different robots.

    Raises:
        InputError: with both names.
    """
    if free_cell.robot.name != cell.robot.name:
        raise InputError(
            f"{free_cell.path} has the robot {free_cell.robot.name}, but {cell.path} has {cell.robot.name}; one fit "
            "needs one robot"
        )


def has_same_tool(free_cell: Cell, cell: Cell) -> bool:
    """Tell whether both bars hang from the same ball of the same tool."""
    one, other = free_cell.tool, cell.tool
    same = np.allclose(one.p_FM, other.p_FM) and np.allclose(one.com_F, other.com_F)
    return bool(same and np.isclose(one.mass, other.mass))


@on_one_thread
def select_circles_beside(free: UnloadedPoses, cell: Cell, pool: Sequence[CirclePlace], count: int) -> np.ndarray:
    """Return the positions in the pool, (count,), of the circles that one fit with the poses gains most from.

    The determinant of the information of geometry, compliances, tool point and zeros is what grows most: greedily, then
    by exchange as long as any swap gains (Fedorov 1972); what the poses say and the prior sigmas stand beneath.

    Raises:
        InputError: the cells have different robots.
    """
    check_robots(free.cell, cell)
    first = unloaded_rows(free)
    parts = [loaded_rows(cell, [c], has_same_tool(free.cell, cell)) for c in pool]
    names = (*first.names, *(n for n in parts[0].names if n not in first.names and not _is_fixture_of_place(n)))
    rows = first.on(names)
    blocks = np.array([_shared_information(p, names) for p in parts])
    return augment_design(rows.T @ rows + np.eye(len(names)), blocks, count)


def _is_fixture_of_place(name: str) -> bool:
    """Tell whether a parameter belongs to one place of the loaded bar alone."""
    return name.startswith("loaded fixture_")


def _shared_information(part: FitRows, names: Sequence[str]) -> Array:
    """Information of a circle about the parameters ``names`` (P, P) in prior sigmas, its fixture left open."""
    own = [n for n in part.names if _is_fixture_of_place(n)]
    rows = part.on((*names, *own))
    return marginal_information(rows.T @ rows, np.arange(len(names) + len(own)) >= len(names))


def collision_free_places(cell: Cell, pool: Sequence[CirclePlace]) -> tuple[CirclePlace, ...]:
    """Return the places where arm and bar, on the way round that was looked at, meet nothing.

    Raises:
        NoSolutionError: there is none.
    """
    out = []
    for c in pool:
        there = Constraints(with_circles(cell, [c]))
        if not there.world.find_near(c.q, there.clearance).any():
            out.append(c)
    if not out:
        raise NoSolutionError(
            f"{cell.path}: on all {len(pool)} circles that the arm can follow it collides: lower motion.clearance_mm, "
            "or check obstacles, the bodies of tool and bar, and base.floor_mm"
        )
    return tuple(out)


def plan_circles_beside(
    cell: Cell, free: UnloadedPoses, pool: Sequence[CirclePlace], places: int, options: PlanOptions, stages: Stages
) -> CircularPlan:
    """Choose places and plan their circles; a place that cannot be driven after all is left out and chosen anew.

    Raises:
        NoSolutionError: so many places cannot be driven.
    """
    most_choices = 6  # of places, each without those that the one before could not drive
    for _ in range(most_choices):
        with stages.stage("choice"):
            which = select_circles_beside(free, cell, pool, places)
        there = with_circles(cell, [pool[int(i)] for i in which])
        starts = {c.name: _start(c, pool[int(i)]) for c, i in zip(circles_of(there), which, strict=True)}
        try:
            return plan_circles(there, options, stages, starts)
        except NoSolutionError as err:
            lost = {int(i) for i in which if not _is_drivable(cell, pool[int(i)], options.seed)}
            if not lost or len(pool) - len(lost) < places:
                raise err
            pool = [c for i, c in enumerate(pool) if i not in lost]
    raise NoSolutionError(
        f"{cell.path}: in {most_choices} choices of {places} places there was each time one that cannot be driven; "
        "ask for fewer --places, or lower motion.clearance_mm"
    )


def _start(circle: Circle, place: CirclePlace) -> Array:
    """Where the way round that was looked at begins, before its overshoot, (N,) [rad]."""
    return np.asarray(place.q[round(-circle.overshoot / (2 * np.pi) * FOLLOWED_ANGLES) % FOLLOWED_ANGLES])


def _is_drivable(cell: Cell, place: CirclePlace, seed: int) -> bool:
    there = with_circles(cell, [place])
    try:
        plan_arc(there, circles_of(there)[0], seed)
    except NoSolutionError:
        return False
    return True


def driven_places(plan: CircularPlan) -> list[CirclePlace]:
    """The circles of a plan, in the way round that it drives."""
    out = []
    for arc in plan.arcs:
        circle = arc.circle
        theta = circle.start + np.arange(FOLLOWED_ANGLES) * 2 * np.pi / FOLLOWED_ANGLES
        q = np.stack([np.interp(theta, arc.angle, column) for column in arc.q.T], axis=1)
        out.append(CirclePlace(circle, plan.cell.fixtures[circle.fixture].p_BX, read_only(q)))
    return out


def check_both_cells(free_cell: Cell, cell: Cell) -> None:
    """Refuse two cells that no one fit can be made of.

    Raises:
        InputError: they differ in robot, tool or base, or the first is not one of a bar without load.
    """
    check_robots(free_cell, cell)
    free_cell.require_bar("the first cell is that of a bar without load, 'edbb'", free=True)
    if not has_same_tool(free_cell, cell):
        raise InputError(
            f"{free_cell.path} and {cell.path} differ in [tool]; one fit needs one tool: both bars hang from the same "
            "ball (map_mm), and the arm carries the same mass_kg at com_mm"
        )
    if not np.allclose(free_cell.base.R_WB, cell.base.R_WB):
        raise InputError(f"{free_cell.path} and {cell.path} differ in base.rpy_deg; the robot stands in one way only")
