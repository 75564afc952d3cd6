"""Further fixtures for a cell, at the places that show most: what ``edbb plan --fixtures`` plans with."""

from dataclasses import dataclass, replace
from string import ascii_uppercase

import numpy as np

from planner.cell.cell import Cell
from planner.cell.file import FixtureFile
from planner.cell.reading import cell_of
from planner.cell.setup import setup_of
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Progress
from planner.common.units import Array, to_mm
from planner.design.undeclared_errors import undeclared_errors
from planner.kinematics.bodies import BodyFile, Vector
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import connected_parts
from planner.studies.fixture_places import place_grid
from planner.studies.fixture_reach import find_stands, move_fixture, reach_poses

ACROSS, UP = 7, 4  # places across the robot's reach, and from the floor up
POSES = 200  # readings by which places are compared
CANDIDATES = 400  # poses at each place
ENOUGH = 100  # of them that must be joined by paths, below which a place is left out
NEAR = 0.1  # [m] between two fixtures


def add_fixtures(cell: Cell, count: int, seed: int, say: Progress) -> Cell:
    """Return the cell with ``count`` fixtures: its first one stays, each other stands where it shows most beside them.

    What holds the first fixture up is built under the others as well.

    A place is judged by the error that the robot's tool would keep anywhere in its workspace once gears and compliance
    were traced as well, after as many readings, spread evenly over the fixtures and their candidates.

    Args:
        cell: the cell, with one fixture.
        count: how many fixtures are wanted.
        seed: of the candidates.
        say: told the stage, and how much of it is done, of how much.

    Raises:
        InputError: the cell has several fixtures already.
        NoSolutionError: there is no other place that the bar reaches.
    """
    if len(cell.file.fixtures) != 1:
        raise InputError(
            f"{cell.path}: --fixtures finds places beside a bar's only fixture, and this cell has "
            f"{len(cell.file.fixtures)} of them: give all in [[fixtures]] without the option, or leave out all but one"
        )
    if count == 1:
        return cell
    seen = _place_informations(cell, seed, say)
    places = [0]
    while len(places) < count:
        tried = [k for k, t in enumerate(seen) if all(_is_apart(t.p_BX, seen[j].p_BX) for j in places)]
        if not tried:
            raise NoSolutionError(
                f"the bar reaches enough poses from {len(places)} places only, {count} fixtures are wanted: "
                "widen the cones or the clearance, or take a longer bar"
            )
        places.append(min(tried, key=lambda k: _expected_square_error([seen[j] for j in (*places, k)])))
    return _build_cell(cell, [seen[k].p_BX for k in places[1:]])


@dataclass(frozen=True)
class _PlaceInformation:
    """What a reading at one place tells, on average: information (P, P) per prior sizes.

    ``own`` (P,) tells which parameters are the place's own; ``weight`` (P, P) is the mean square error of the tool
    per squared errors in prior sizes.
    """

    p_BX: Array
    information: Array
    own: np.ndarray
    weight: Array


def _place_informations(cell: Cell, seed: int, say: Progress) -> list[_PlaceInformation]:
    """The places of the grid from which enough poses are reached, that of the present fixture first."""
    q = reach_poses(cell, cell.fixtures[0].p_BX, CANDIDATES, seed).q
    unknown = undeclared_errors(move_fixture(cell, cell.fixtures[0].p_BX), q, np.zeros(len(q), dtype=int))
    own = np.array([name.startswith("fixture_") for name in unknown.model.names])
    _, places = place_grid(cell, ACROSS, UP)
    out = []
    for k, place in enumerate(places):
        say("fixtures", k, len(places))
        q = _connected_poses(cell, place.p_BX, seed)
        if len(q) >= ENOUGH or k == 0:
            here = replace(unknown, model=replace(unknown.model, setup=setup_of(move_fixture(cell, place.p_BX))))
            white = here.white(q)
            out.append(_PlaceInformation(place.p_BX, white.T @ white / len(q), own, unknown.weight_per_prior))
    return out


def _connected_poses(cell: Cell, place: Array, seed: int) -> Array:
    """Poses (n, N) [rad] about a fixture at ``place``, of which each is reached from each other with the bar on."""
    q = reach_poses(cell, place, CANDIDATES, seed).q
    return q[connected_parts(Constraints(move_fixture(cell, place).unwound), q, seed) == 0] if len(q) else q


def _expected_square_error(places: list[_PlaceInformation]) -> float:
    """Mean square error of the tool to be expected once ``POSES`` readings were shared by fixtures at ``places``."""
    own, weight = places[0].own, places[0].weight
    total = np.eye(int((~own).sum()))
    for place in places:
        told = place.information * (POSES / len(places))
        placed = told[np.ix_(own, own)] + np.eye(int(own.sum()))
        across = told[np.ix_(~own, own)]
        total += told[np.ix_(~own, ~own)] - across @ np.linalg.solve(placed, across.T)
    return float((weight[np.ix_(~own, ~own)] * np.linalg.inv(total)).sum())


def _is_apart(one: Array, other: Array) -> bool:
    return float(np.linalg.norm(one - other)) > NEAR


def _build_cell(cell: Cell, places: list[Array]) -> Cell:
    """The cell with a fixture at each place, and what holds it."""
    first, file = cell.file.fixtures[0], cell.file
    names = [n for n in ascii_uppercase if n != first.name]
    cups, held = list(file.fixtures), list(file.obstacles)
    for name, place in zip(names, places, strict=False):
        x, y, z = (float(v) for v in np.round(to_mm(place)))
        cups.append(FixtureFile(name=name, position_mm=(x, y, z), axis=first.axis, prior_mm=first.prior_mm))
        step = np.array([x, y, z]) - np.array(first.position_mm)
        held += [_copy_stand(file.obstacles[k], step, name) for k in find_stands(cell)]
    gauge = file.gauge.model_copy(update={"mount_deg": None})  # it holds the bar at the first fixture only
    cups[0] = first.model_copy(update={"mount_deg": first.mount_deg or file.gauge.mount_deg})
    grown = file.model_copy(update={"fixtures": tuple(cups), "obstacles": tuple(held), "gauge": gauge})
    return cell_of(grown, cell.path, cell.name)


def describe_added_fixtures(cell: Cell) -> tuple[str, ...]:
    """Return where further fixtures of a cell are to be put up, and on what, one sentence each."""
    return tuple(
        f"fixture {f.name} is to be put up at [{', '.join(f'{v:.0f}' for v in f.position_mm)}] mm"
        + ("" if not held else f", on what holds the first one up ({', '.join(held)} in cell.toml)")
        for f in cell.file.fixtures[1:]
        for held in [[b.name for b in cell.file.obstacles if b.name and b.name.endswith(f" of fixture {f.name}")]]
    )


def _copy_stand(body: BodyFile, step: Array, name: str) -> BodyFile:
    """The same body under another fixture, ``step`` (3,) [mm] away: its foot stays down, its top follows."""
    change: dict[str, object] = {"name": f"{body.name or body.kind} of fixture {name}"}
    level = np.array([step[0], step[1], 0.0])
    if body.kind == "capsule" and body.from_mm is not None and body.to_mm is not None:
        foot, top = sorted((body.from_mm, body.to_mm), key=lambda p: p[2])
        raised = np.array(top) + step
        raised[2] = max(raised[2], foot[2])
        change |= {"from_mm": _vector(np.array(foot) + level), "to_mm": _vector(raised)}
    elif body.kind == "box" and body.at_mm is not None and body.size_mm is not None and body.rpy_deg[:2] == (0.0, 0.0):
        tall = max(body.size_mm[2] + step[2], 1.0)
        up = np.array([0.0, 0.0, (tall - body.size_mm[2]) / 2])
        change |= {"at_mm": _vector(np.array(body.at_mm) + level + up), "size_mm": (*body.size_mm[:2], tall)}
    else:
        change |= {"at_mm": _vector(np.array(body.at_mm or (0.0, 0.0, 0.0)) + step)}
    return body.model_copy(update=change)


def _vector(p: Array) -> Vector:
    x, y, z = (round(float(v), 6) for v in p)
    return x, y, z
