"""``expected_error.json``: what is known of a calibrated robot's errors, small enough to be asked at any pose and tool.

The covariance of the parameters that move the tool is kept as a root of few columns: the directions in which the tool's
error is largest over the workspace, of the measured tool and of others (principal components of tool motion times
root). What these lack, mostly ripple that is alike everywhere, stands as one number for each of the two. Errors are
those after the best alignment of the base over the workspace, as in ``known_anywhere_mm``.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from planner.cell.cell import MeasurementSetup
from planner.common.content_hashes import hand_edits, with_hashes
from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.common.schema import StrictModel, read_json, validate
from planner.common.units import Array, from_deg, from_mm, read_only, round_significant_digits, to_deg, to_mm
from planner.documents.calibrated_robot import MovedBy, describe_moves, effect_parameter, loaded_robot
from planner.effects.effect import Parameter
from planner.kinematics.bodies import Vector
from planner.kinematics.robot import Robot, ToolPoint
from planner.kinematics.robot_hash import is_model_of, model_text_hash
from planner.model.model import chunks
from planner.model.tool_error import tool_rows, tool_setup
from planner.release.error_parts import error_parts
from planner.release.released_robot import ReleasedRobot
from planner.release.tool_map import ToolMap, moving_effects
from planner.runs.run import Run, Samples


def expected_error_csv(released: ReleasedRobot) -> str:
    """Return the table: joint angles, where the measured tool point is, and its likely error of three robots.

    The rms of a column is the robot's error over the workspace as ``identification.json`` and the report state it.
    """
    tool = released.tool
    head = released.fit.setup.robot.joint_columns("q")
    head += ["x_mm", "y_mm", "z_mm", "nominal_mm", "geometry_mm", "released_mm"]
    errors = [released.likely_errors(fit) for fit in (None, released.geometry, released.fit)]
    rows = np.column_stack([to_deg(tool.q), to_mm(tool.position), to_mm(np.stack(errors, axis=1))])
    text = "\n".join(",".join(f"{v + 0.0:.4f}" for v in row) for row in rows.round(4))
    return ",".join(head) + "\n" + text + "\n"


NAME = "expected_error.json"  # beside robot.toml
ExpectedErrorContent = Mapping[str, object]
"""What the file says, by its keys."""
DIGITS = 6  # significant ones
OTHER = "?"  # name of a tool point that was not measured: no parameter of the file has it


class KnownParameter(StrictModel):
    """A parameter that moves the tool: of the geometry by its name alone, an effect with all that it moves [m, rad]."""

    name: str
    moves: tuple[MovedBy, ...] = ()

    @property
    def point(self) -> str | None:
        """Name of the tool point that it places, empty for a lone one; ``None`` for a parameter of the robot."""
        return self.name.removeprefix("map_")[:-1].removesuffix("_") if self.name.startswith("map_") else None


class StandingGauge(StrictModel):
    """Where the gauge of the last run stands: what a run that finds it as it was left need not find anew.

    Attributes:
        mounting: name of the set-up; empty where no plan and no cell names it.
        fixtures_mm: places that the values count from.
        parameters: of place and zero, G; ``values`` of them [m].
        spread: root of the covariance of the robot's parameters and of these, (P + G, r).
    """

    mounting: str = ""
    fixtures_mm: dict[str, Vector]
    parameters: tuple[str, ...]
    values: tuple[float, ...]
    spread: tuple[tuple[float, ...], ...]


class ExpectedErrorFile(StrictModel):
    """The file.

    Attributes:
        robot_sha256: of what the ``robot.toml`` that it belongs to says, however controllers count its axes (of older
            files: of its bytes).
        tool_mm: measured tool point in the flange frame of the released robot, the first one of several.
        further_points_mm: the other measured tool points, by name, where the tool has several.
        parameters: P that move the tool.
        nominal, geometry, released: values of the three robots less what the run expects, (P,) [m, rad, …].
        spread: root of the parameters' covariance, (P, r).
        rest_mm, rest_other_mm: tool error that the root lacks, rms, of the measured tool and of others: small
            directions, and what poses held out show that follows no column.
        likely_share: error over the workspace that is as likely exceeded as not, over the root of the expected mean
            square: of nominal, geometry and released robot.
        parts_mm: error over the workspace by its parts: ``seen`` (noise and number of readings), ``unseen`` (what more
            readings at the same poses cannot show: scale, tool, other postures) and ``misfit`` (no named cause).
        states_deg: joint states at which the base is aligned, (n, N).
        gauge: where the gauge stands, of a bar or wire.
        hashes: of its keys, as it was written; none of files of earlier versions.
    """

    schema_: Literal["edbb-expected-error/1"] = Field(alias="schema")
    robot: str
    robot_sha256: str
    tool_mm: Vector
    further_points_mm: dict[str, Vector] = Field(default_factory=dict)
    parameters: tuple[KnownParameter, ...]
    nominal: tuple[float, ...]
    geometry: tuple[float, ...]
    released: tuple[float, ...]
    spread: tuple[tuple[float, ...], ...]
    rest_mm: float
    rest_other_mm: float
    likely_share: tuple[float, float, float] = (1.0, 1.0, 1.0)
    parts_mm: dict[Literal["seen", "unseen", "misfit", "drift"], float] = Field(default_factory=dict)
    states_deg: tuple[tuple[float, ...], ...]
    gauge: StandingGauge | None = None
    hashes: dict[str, str] = {}


def expected_error_text(content: ExpectedErrorContent, robot_toml: str, mounting: str = "") -> str:
    """Return the text of the file that goes with ``robot_toml``; ``mounting``: name of the set-up of the last run."""
    whole = {**content, "robot_sha256": model_text_hash(robot_toml)}
    if isinstance(standing := whole.get("gauge"), dict):
        whole["gauge"] = {**standing, "mounting": mounting}
    return json.dumps(with_hashes(whole), ensure_ascii=False) + "\n"


def expected_error_content(released: ReleasedRobot, run: Run) -> ExpectedErrorContent:
    """Return what the file says, the names of robot file and set-up left open; ``run``: that was identified."""
    tool, setup, points, names = released.tool, released.fit.setup, released.measured_points, released.moving_names
    maps = (*points, *released.other_tools)
    root, squares = _few_columns(released.spread(names), maps, names)
    rest = [s - _mean_square(root, m, names) for s, m in zip(squares, maps, strict=True)]
    rest = [released.beside_square + max(square, 0.0) for square in rest]
    offsets = {
        name: round_significant_digits(released.offset(names, fit), DIGITS).tolist()
        for name, fit in (("nominal", None), ("geometry", released.geometry), ("released", released.fit))
    }
    first, *further = (
        (name, round_significant_digits(to_mm(p_FM), DIGITS).tolist()) for name, p_FM in released.tool_points.items()
    )
    few = tool.q[even_positions(len(tool.q), 300)]  # states at which the base is aligned
    return {
        "schema": "edbb-expected-error/1",
        "robot": setup.robot.name,
        "robot_sha256": "",
        "tool_mm": first[1],
        **({"further_points_mm": dict(further)} if further else {}),
        "parameters": list(_describe(names, moving_effects(released.posterior.fit), setup, several=bool(further))),
        **offsets,
        "spread": round_significant_digits(root, DIGITS).tolist(),
        "rest_mm": float(round_significant_digits(to_mm(np.sqrt(max(rest[: len(points)]))), DIGITS)),
        "rest_other_mm": float(round_significant_digits(to_mm(np.sqrt(np.mean(rest[len(points) :]))), DIGITS)),
        "likely_share": [
            float(round_significant_digits(released.likely_share(f), DIGITS))
            for f in (None, released.geometry, released.fit)
        ],
        "parts_mm": {
            name: float(round_significant_digits(to_mm(value), DIGITS))
            for name, value in dict(error_parts(released)).items()
        },
        "states_deg": np.round(to_deg(few), 3).tolist(),
        **_standing_gauge(released, run),
    }


def _standing_gauge(released: ReleasedRobot, run: Run) -> dict[str, object]:
    """Return the place of the last run's gauge and its covariance; ``None`` for a gauge without lasting places.

    Errors of the robot that a gauge elsewhere would take up are as open as the gauge's place, and only both together
    are known: so the root has all directions that move either the tool or the readings.
    """
    setup, known = released.fit.setup, released.posterior.fit
    stands = setup.gauge.kept_mounting(setup)
    own = {name: own for name, own in stands.names.items() if name in known.values}
    if not own:
        return {}
    names = [*released.moving_names, *own]
    root = released.spread(names)
    few = run.samples.take(even_positions(len(run), 300))  # readings say which directions move them
    rows = known.model.rows(few)[:, 0] / known.model.noise(few)[:, None]
    at = [known.model.names.index(n) if n in known.model.names else -1 for n in names]
    seen = np.where(np.array(at) >= 0, rows[:, at], 0.0) @ root
    moved = seen.T @ seen
    for each in (*released.measured_points, *released.other_tools):
        motion = _tool_motion(root, each, names)
        # 10: as much as ten readings of one standard deviation each
        moved += 10.0 * motion.T @ motion / max(float((motion**2).sum()), 1e-300)
    square, turn = np.linalg.eigh(moved)
    kept = square > 1e-3 * len(few) / len(square)  # all that is left out moves no reading by more than 3 % of its noise
    gauge = {
        "mounting": "",
        "fixtures_mm": {name: round_significant_digits(to_mm(p), 8).tolist() for name, p in stands.places.items()},
        "parameters": list(own.values()),
        "values": [float(round_significant_digits(known.values[name], DIGITS)) for name in own],
        # 5: digits that tell a hundredth of a micrometre of a reading
        "spread": round_significant_digits(root @ turn[:, kept], 5).tolist(),
    }
    return {"gauge": gauge}


def _few_columns(root: Array, maps: Sequence[ToolMap], names: Sequence[str]) -> tuple[Array, list[float]]:
    """Return a root of fewer columns (P, r), which lacks little of the error of the tools of ``maps``.

    And the mean square error [m²] of each of these by the whole root.
    """
    moved, squares = np.zeros((root.shape[1], root.shape[1])), list[float]()
    for tool in maps:
        own = _tool_motion(root, tool, names)
        total = float((own**2).sum())
        moved += own.T @ own / max(total, 1e-300)
        squares.append(total / len(tool.q))
    square, turn = np.linalg.eigh(moved)
    part = np.cumsum(np.maximum(square[::-1], 0.0))
    count = 1 + int(np.argmax(part >= (1 - 0.03) * part[-1]))  # part of the mean square error that the directions lack
    return np.asarray(root @ turn[:, ::-1][:, :count]), squares


def _mean_square(root: Array, tool: ToolMap, names: Sequence[str]) -> float:
    return float((_tool_motion(root, tool, names) ** 2).sum()) / len(tool.q)


def _tool_motion(root: Array, tool: ToolMap, names: Sequence[str]) -> Array:
    at = [list(names).index(n) for n in tool.names]
    return np.asarray(tool.rows.reshape(-1, len(at)) @ root[at])


def _describe(
    names: Sequence[str], effects: Sequence[Parameter], setup: MeasurementSetup, several: bool
) -> Iterator[dict[str, object]]:
    moves = {p.name: describe_moves(p, setup) for p in effects}
    for name in names:
        moved = {"moves": moves[name]} if name in moves else {}
        yield {"name": f"map_{name[-1]}" if name.startswith("map_") and not several else name, **moved}


@dataclass(frozen=True)
class ErrorAtPoses:
    """Tool error of n poses [m], (n,): of the nominal robot, of geometry alone, and of the released one.

    It is what is expected there, on the scale of the error over the workspace that is as likely exceeded as not.
    """

    nominal: Array
    geometry: Array
    released: Array


@dataclass(frozen=True)
class ExpectedError:
    """What is known of the errors of a calibrated robot: those of a nominal robot with the file's parameters."""

    file: ExpectedErrorFile
    robot: Robot

    @classmethod
    def read(cls, robot: Robot, robot_file: Path) -> "ExpectedError | str":
        """Read the file beside a ``robot.toml``, or return the reason why nothing is known of that robot's error.

        Raises:
            InputError: the file is there and cannot be understood.
        """
        path = robot_file.parent / NAME
        if not path.is_file():
            return f"no {NAME} lies beside {robot_file.name} ('edbb identify' writes both)"
        content = read_json(path)
        file = validate(content, ExpectedErrorFile, str(path))
        if edited := hand_edits(path, content):
            return f"{edited[0].sentence}; put the file back as it was written, or identify again"
        if not is_model_of(robot_file, file.robot_sha256):
            return (
                f"{NAME} belongs to another {robot_file.name}: one of them was exchanged, or changed in more than how "
                f"controllers count ([controllers]). One of an earlier version holds for {robot_file.name} as it was "
                "written, to the byte: identify again"
            )
        found = cls(file, robot)
        found.check(path)
        return found

    def check(self, path: Path) -> None:
        """Refuse a file whose numbers do not belong together.

        Raises:
            InputError: with what does not fit.
        """
        P, N = len(self.file.parameters), self.robot.n_joints
        lists = (self.file.nominal, self.file.geometry, self.file.released, self.file.spread)
        if any(len(v) != P for v in lists) or len({len(row) for row in self.file.spread}) > 1:
            raise InputError(f"{path}: {P} parameters need {P} numbers each in nominal, geometry, released and spread")
        if any(len(q) != N for q in self.file.states_deg) or not self.file.states_deg:
            raise InputError(f"{path}: states_deg needs {N} angles a state")
        try:
            known = {name for point in self.points for name in self._rows(self._states[:1], point)[0]}
        except ValueError as err:
            raise InputError(f"{path}: an effect moves a transform that {self.robot.name} does not have") from err
        if missing := [p.name for p in self.file.parameters if p.name not in known]:
            raise InputError(f"{path}: '{missing[0]}' is no parameter of {self.robot.name}")

    @property
    def tool(self) -> Array:
        """The first measured tool point in the flange frame, (3,) [m]."""
        return read_only(from_mm(self.file.tool_mm))

    @cached_property
    def points(self) -> tuple[ToolPoint, ...]:
        """The measured tool points; the first one has the first name among the parameters."""
        names = dict.fromkeys(p.point for p in self.file.parameters if p.point is not None)
        further = self.file.further_points_mm
        first = next((name for name in names if name not in further), "")
        every = {first: self.file.tool_mm, **further}
        return tuple(ToolPoint(name, read_only(from_mm(p_mm))) for name, p_mm in every.items())

    def find_point(self, p_FM: Array) -> ToolPoint:
        """Return the measured point at which a tool point (3,) [m] sits, else that tool with a name of no parameter."""
        nearest = min(self.points, key=lambda point: float(np.linalg.norm(p_FM - point.p_FM)))
        # 1e-3: [m] nearer to a measured point a tool is that point
        return nearest if np.linalg.norm(p_FM - nearest.p_FM) < 1e-3 else ToolPoint(OTHER, p_FM)

    def is_measured(self, p_FM: Array) -> bool:
        """Tell whether a tool point (3,) [m] is one that was measured."""
        return self.find_point(p_FM).name != OTHER

    def at(self, q: Array, p_FM: Array) -> ErrorAtPoses:
        """Return the expected errors at q (n, N) [rad] of a tool point (3,) [m] in the flange frame.

        Of a point that was not measured it counts as known where it sits in the true flange.
        """
        frame, motion = self._motion(self._states, p_FM, self._vectors)
        shift = np.linalg.lstsq(frame, motion)[0]
        square = np.empty((len(q), self._vectors.shape[1]))
        for part in chunks(len(q), 512):  # poses a pass
            frame, motion = self._motion(q[part], p_FM, self._vectors)
            square[part] = ((motion - frame @ shift) ** 2).reshape(len(q[part]), 3, -1).sum(axis=1)
        rest = self.file.rest_mm if self.is_measured(p_FM) else self.file.rest_other_mm
        known = square[:, 3:].sum(axis=1) + float(from_mm(rest)) ** 2
        return ErrorAtPoses(*(s * np.sqrt(square[:, k] + known) for k, s in enumerate(self.file.likely_share)))

    def aligned_spread(self, q: Array, p_FM: Array | None = None) -> Array:
        """Return how far a tool point moves at q (n, N) [rad] by each column of the root, (n, 3, r) [m].

        It is the measured one, or ``p_FM`` (3,) [m] in the flange, which counts as known where it was not measured.
        The base is aligned anew, over the file's own states.
        """
        return self.aligned_motion(q, self.spread, p_FM)

    @property
    def spread(self) -> Array:
        """The root of the covariance of the parameters, (P, r)."""
        return self._vectors[:, 3:]

    @property
    def spread_with_gauge(self) -> Array:
        """The root of their covariance together with where the gauge stands, (P + G, r)."""
        gauge = self.file.gauge
        return self.spread if gauge is None else np.array(gauge.spread)

    def aligned_motion(self, q: Array, spread: Array, p_FM: Array | None = None) -> Array:
        """Return how far a tool point moves at q (n, N) [rad] by each column of errors (P, r), as above."""
        tool = self.tool if p_FM is None else p_FM
        shift = np.linalg.lstsq(*self._motion(self._states, tool, spread))[0]
        frame, motion = self._motion(q, tool, spread)
        return np.asarray((motion - frame @ shift).reshape(len(q), 3, -1))

    def _motion(self, q: Array, p_FM: Array, vectors: Array) -> tuple[Array, Array]:
        """Tool motion per how the base stands, (3 n, 6), and by each vector of errors (P, k), (3 n, k) [m].

        Where the other measured points sit on the tool does not move this one.
        """
        point = self.find_point(p_FM)
        names, frame, rows = self._rows(q, replace(point, p_FM=p_FM))
        acting = [k for k, p in enumerate(self.file.parameters) if p.point in (None, point.name)]
        at = [names.index(self.file.parameters[k].name) for k in acting]
        return frame, rows[:, at] @ vectors[acting]

    def _rows(self, q: Array, point: ToolPoint) -> tuple[tuple[str, ...], Array, Array]:
        robot = replace(loaded_robot(self.robot), robot=self.robot.nominal_robot)
        setup = replace(tool_setup(robot, point.p_FM), point_names=(point.name,))
        samples = Samples(q, np.zeros(len(q), dtype=int), payload=np.zeros(len(q)))
        effects = [effect_parameter(p.name, p.moves, setup) for p in self.file.parameters if p.moves]
        return tool_rows(samples, setup, effects)

    @cached_property
    def _states(self) -> Array:
        return read_only(from_deg(np.array(self.file.states_deg)))

    @cached_property
    def _vectors(self) -> Array:
        """Errors of the nominal robot, of geometry alone and of the released one, then the root: (P, 3 + r)."""
        offsets = np.stack([self.file.nominal, self.file.geometry, self.file.released], axis=1)
        return np.concatenate([offsets, np.array(self.file.spread).reshape(len(offsets), -1)], axis=1)
