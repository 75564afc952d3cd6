"""A measured run: where the arm stood, what the gauge read, and what else was logged, in SI units.

Readings of one number that is neither a length nor a position: a gauge brings the column that it has in a run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np

from planner.common.errors import InputError
from planner.common.numbers import number_of, parse_number
from planner.common.units import Array, IntArray, Rows, from_mm, read_only, to_mm

SIMULATED = "simulated, nobody measured this"
"""What the comment line ``# truth:`` of a simulated run begins with."""


class Mounting(NamedTuple):
    """Between what a gauge is held: one of the fixtures and one of the tool's points, both counted from 0."""

    fixture: int = 0
    point: int = 0


FIRST_MOUNTING = Mounting()


@dataclass(frozen=True)
class Samples(Rows):
    """Where the arm stood and under which circumstances, one entry a sample; what was not logged is ``None``.

    Attributes:
        q: controller angles at which the arm stood, as far as is known, (n, N) [rad].
        place: index into the names of fixtures, sockets' plates or tracker stations, (n,) int.
        t: time [s], (n,).
        q_cmd: commanded angles (n, N) [rad]; ``q_read``: angles as read (n, N) [rad].
        session: number of the session, (n,) int.
        pose: id of the pose, (n,) int.
        point: index of the target on the tool, (n,) int.
        temperature: (n,) [°C].
        force: pull along the bar, (n,) [N].
        torque: measured joint torques, (n, N) [Nm].
        payload: (n,) [kg].
        direction: sign of each axis' last approach, (n, N).
        length: as the bar showed it, (n,) [m].
        reversals: angles at each joint's last reversals, (n, N, M) [rad], the latest last.
        number: of each sample in the run as it was measured, from 0, (n,) int.
        speed: of the controller angles where the run is continuous, (n, N) [rad/s].
        file: index of the file that a sample was read from, (n,) int; ``line``: its line there (row of a Parquet file).
        seen: which corners of a board the image shows, (n, K) bool.
    """

    q: Array
    place: IntArray
    t: Array | None = None
    q_cmd: Array | None = None
    q_read: Array | None = None
    session: IntArray | None = None
    pose: IntArray | None = None
    point: IntArray | None = None
    temperature: Array | None = None
    force: Array | None = None
    torque: Array | None = None
    payload: Array | None = None
    direction: Array | None = None
    speed: Array | None = None
    length: Array | None = None
    reversals: Array | None = None
    number: IntArray | None = None
    file: IntArray | None = None
    line: IntArray | None = None
    seen: np.ndarray | None = None

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.q)

    @classmethod
    def at(cls, q: Array, mounting: Mounting = FIRST_MOUNTING) -> "Samples":
        """Return samples at angles q (n, N) [rad] that all have the gauge held in one way."""
        place, point = (read_only(np.full(len(q), k), int) for k in mounting)
        return cls(q, place, point=point)

    @property
    def point_numbers(self) -> IntArray:
        """Index of the target on the tool, (n,) int; 0 where none is logged."""
        return np.zeros(len(self), dtype=np.int64) if self.point is None else self.point

    @property
    def session_numbers(self) -> IntArray:
        """Number of the session, (n,) int; 0 where none is logged."""
        return np.zeros(len(self), dtype=np.int64) if self.session is None else self.session

    def mounting(self, k: int) -> Mounting:
        """Return how the gauge is held at sample ``k``."""
        return Mounting(int(self.place[k]), 0 if self.point is None else int(self.point[k]))

    def at_mounting(self, mounting: Mounting) -> np.ndarray:
        """Tell which samples have the gauge held like that, (n,) bool."""
        return np.asarray((self.place == mounting.fixture) & (self.point_numbers == mounting.point))


@dataclass(frozen=True)
class Readings(Rows):
    """What the gauge read, one entry a sample: one of length, position (and rotation), socket, or image.

    Attributes:
        length: (n,) [m].
        position: of the target in the gauge's own frame G, p_GM (n, 3) [m].
        rotation: of the probe, R_GM (n, 3, 3).
        turns: what its columns hold of that, rx, ry, rz (n, 3) [rad] or a quaternion x, y, z, w (n, 4).
        ball: index of the ball or socket that the point sits in, (n,) int.
        offset: of the point from that ball's centre in the plate's axes, (n, 3) [m].
        pixels: corners of a board in an image, (n, K, 2) [px], NaN where one is not seen.
    """

    length: Array | None = None
    position: Array | None = None
    rotation: Array | None = None
    turns: Array | None = None
    ball: IntArray | None = None
    offset: Array | None = None
    pixels: Array | None = None

    @property
    def columns(self) -> str:
        """Columns of a run with them: ``length_mm``, ``x_mm, y_mm, z_mm``, ``ball``, or ``corner, u_px, v_px``."""
        if self.pixels is not None:
            return "corner, u_px, v_px"
        if self.length is not None:
            return "length_mm"
        return "ball" if self.position is None else "x_mm, y_mm, z_mm"


@dataclass(frozen=True)
class Run:
    """One measured run, loaded and checked.

    Attributes:
        name: of the file.
        samples: where the arm stood.
        readings: what the gauge read.
        places: names that ``samples.place`` counts (fixtures, plates, stations; one unnamed place is ``""``).
        balls: names that ``readings.ball`` counts.
        points: names that ``samples.point`` counts.
        continuous: whether the samples follow each other along a driven path; else each is a pose at rest.
        clocks: 2 where gauge and controller were logged apart, each by its own clock, else 1.
        plan_id, robot: from the comment lines, ``None`` where not given.
        warnings: what a person should know.
        files: names that ``samples.file`` counts.
        simulated: whether its comment lines say so.
        slides: numbers, from 1, of the joints that slide.
        turns_as: how ``readings.turns`` turn the probe (:mod:`planner.runs.probe_turns`), empty where nothing says it.

    Example:
        >>> run = load_run("run.csv")  # doctest: +SKIP
        >>> run.samples.q  # (n, N) rad  # doctest: +SKIP
        >>> run.readings.length  # (n,) m, of a bar or wire  # doctest: +SKIP
    """

    name: str
    samples: Samples
    readings: Readings
    places: tuple[str, ...] = ("",)
    balls: tuple[str, ...] = ()
    points: tuple[str, ...] = ("",)
    continuous: bool = False
    clocks: int = 1
    plan_id: str | None = None
    robot: str | None = None
    warnings: tuple[str, ...] = field(default=())
    files: tuple[str, ...] = ()
    simulated: bool = False
    slides: frozenset[int] = frozenset()
    turns_as: str = ""

    def __repr__(self) -> str:
        """Name the run, and say how long it is."""
        kind = type(self).__name__
        return f"{kind}('{self.name}', samples={len(self)}, plan_id={self.plan_id!r}, simulated={self.simulated})"

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.samples)

    @property
    def counts_text(self) -> str:
        """How many readings it has, at how many poses or along how long a drive."""
        readings = f"{number_of(len(self), 'reading')} ({self.readings.columns})"
        if self.continuous:
            t = self.samples.t
            return f"{readings} along a drive" + ("" if t is None else f" of {np.ptp(t):.6g} s")
        same = 1e-6  # [rad] within which commanded angles are one pose
        pose = self.samples.pose
        each = np.unique(np.round(self.samples.q / same), axis=0) if pose is None else np.unique(pose[pose >= 0])
        return f"{readings} at {number_of(len(each), 'pose')}"

    def where(self, k: int) -> str:
        """Return where sample k, from 0, stands: ``"run.csv, line 12"``; its number where no file is known."""
        s = self.samples
        if s.file is None or s.line is None:
            return f"number {k + 1}"
        name = self.files[s.file[k]]
        return f"{name}, {'row' if name.lower().endswith('.parquet') else 'line'} {s.line[k]}"

    def where_at_pose(self, k: int) -> str:
        """Return where sample k, from 0, stands, with its pose where it has one: ``"run.csv, line 12 (pose 9)"``."""
        pose = self.samples.pose
        return self.where(k) + ("" if pose is None else f" (pose {pose[k]})")

    def take(self, which: slice | np.ndarray) -> "Run":
        """Return the run with only the samples at ``which`` (a slice, indices, or a mask)."""
        return replace(self, samples=self.samples.take(which), readings=self.readings.take(which))


def index_names(values: Sequence[str]) -> tuple[IntArray, tuple[str, ...]]:
    """Return the index of each name (n,) in the sorted names (numbers by value), and these."""
    names = sort_names(set(values))
    place = {name: i for i, name in enumerate(names)}
    return read_only([place[v] for v in values], np.int64), names


def sort_names(names: set[str]) -> tuple[str, ...]:
    """Return names in an order of their own: whole numbers by value, then the others by letters."""
    return tuple(sorted(names, key=lambda n: (0, int(n), n) if n.lstrip("-").isdecimal() else (1, 0, n)))


NEST, MASTER = "nest_mm", "master_mm"


@dataclass(frozen=True)
class ReferenceReadings:
    """Readings beside the poses: nests by name p_GN (3,) [m]; indicators at the master ball, each (3,) [m]."""

    nests: tuple[tuple[str, Array], ...] = ()
    masters: tuple[Array, ...] = ()

    def lines(self) -> tuple[str, ...]:
        """Return the lines that say so above the columns of a run."""
        nests = [f"{NEST}: {name}, {_numbers(p)}" for name, p in self.nests]
        return (*nests, *(f"{MASTER}: {_numbers(m)}" for m in self.masters))


NO_REFERENCE_READINGS = ReferenceReadings()


def read_reference_readings(path: Path) -> ReferenceReadings:
    """Read what stands above the columns of the run at ``path``; a Parquet file has no such lines.

    Raises:
        InputError: the file cannot be read, or a line has not the numbers that it should.
    """
    if path.suffix.lower() == ".parquet":
        return NO_REFERENCE_READINGS
    nests, masters = list[tuple[str, Array]](), list[Array]()
    from planner.runs.text import read_lines, split_head  # with polars, which costs most of a second

    for k, line in enumerate(split_head(read_lines(path))[0], start=1):
        key, _, text = line.lstrip("# \t").partition(":")
        words = [w.strip() for w in text.split(",")]
        if key.strip() == NEST:
            nests.append((words[0], _point(path, k, line, words[1:])))
        if key.strip() == MASTER:
            masters.append(_point(path, k, line, words))
    return ReferenceReadings(tuple(nests), tuple(masters))


def _point(path: Path, k: int, line: str, words: list[str]) -> Array:
    try:
        found = np.array([parse_number(w) for w in words])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise InputError(
            f"{path}, line {k}: '{line}' should be '# {NEST}: NAME, x, y, z' or '# {MASTER}: x, y, z', in millimetres"
        )
    return read_only(from_mm(found))


def _numbers(p: Array) -> str:
    return ", ".join(f"{v:.{6}f}" for v in to_mm(p))  # decimals of a millimetre, as lines are written


@dataclass(frozen=True)
class ScalarReadings(Readings):
    """One number a sample; the base of what a gauge registers with :func:`register_scalar`.

    Attributes:
        scalar: (n,) in SI units.
    """

    scalar: Array | None = None

    key: ClassVar[str]
    """Name of the column without its unit."""
    units: ClassVar[Mapping[str, float]]
    """Units that the column may be written in, with their factors to SI; it is written in the first."""
    plausible: ClassVar[tuple[float, float]]
    """Lowest and highest of any cell, in SI."""

    @property
    def columns(self) -> str:
        """Its column of a run."""
        return column_of(type(self))


S = TypeVar("S", bound=type[ScalarReadings])
_SCALARS: dict[str, type[ScalarReadings]] = {}


def register_scalar(kind: S) -> S:
    """Make a scalar reading known by its column; a class decorator.

    Raises:
        ValueError: another one has that column.
    """
    if kind.key in _SCALARS:
        raise ValueError(f"column '{kind.key}': {_SCALARS[kind.key].__module__} has registered it already")
    _SCALARS[kind.key] = kind
    return kind


def scalar_kinds() -> Mapping[str, type[ScalarReadings]]:
    """Return the scalar readings that are known, by their keys."""
    return _SCALARS


def column_of(kind: type[ScalarReadings]) -> str:
    """Return the column that a scalar reading is written in."""
    return f"{kind.key}_{next(iter(kind.units))}"
