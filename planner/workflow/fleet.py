"""``fleet()``: how large the errors of a kind of robot are, from several of them.

How large the errors of robots of one kind are, joint by joint, from the calibrations of several of them.

Hierarchical empirical Bayes: each robot's errors of a group (lengths or angles of a joint, its compliance, its gear)
are normal with the group's size, whose square is scaled-inverse-chi-square about the usual one, with ν = 4 degrees of
freedom (``planner.design.learnt_sizes``; Efron and Morris 1973, JASA 68(341); Gelman et al., BDA 3, 5.1). So two robots
change a size little, twenty much. What a robot's readings do not show, they do not count.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from planner.cell.fleet_file import FleetFile, FleetSize
from planner.checks.record import RecordFile, RobotRecord
from planner.common.console import as_word
from planner.common.content_hashes import HandEdit, with_hashes
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.result import Result
from planner.common.schema import read_toml
from planner.common.summary import Summary
from planner.design.learnt_sizes import LearntSizes, learn_sizes
from planner.identification.fleet_fit import Misfit, RobotErrors, misfits_of
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Identification

IDENTIFICATION, RECORD, ROBOT = "identification.json", "record.toml", "robot.toml"


@dataclass(frozen=True)
class Fleet:
    """Several robots of a kind, and the sizes of their errors."""

    robot: str
    robots: tuple[RobotErrors, ...]
    groups: tuple[str, ...]
    sizes: LearntSizes
    hand_edits: tuple[HandEdit, ...] = ()

    @classmethod
    def of(cls, robot: str, robots: Sequence[RobotErrors]) -> "Fleet":
        """Estimate the sizes of the errors of a kind of robot.

        Raises:
            InputError: one robot alone.
        """
        if len(robots) < 2:
            raise InputError(f"{robots[0].name if robots else 'nothing'}: one robot is no fleet: give two or more")
        groups = tuple(dict.fromkeys(g for r in robots for g in r.groups))
        number = np.array([groups.index(g) for r in robots for g in r.groups], dtype=int)
        value, std = (np.concatenate([getattr(r, key) for r in robots]) for key in ("value", "std"))
        return cls(robot, tuple(robots), groups, learn_sizes(value, std, number, len(groups)))

    def file(self) -> FleetFile:
        """Return what ``fleet.toml`` says."""
        sizes = zip(self.groups, self.sizes.factors, self.sizes.log_std, self.sizes.seen, strict=True)
        rows = [
            FleetSize(group=g, factor=round(float(f), 5), log_std=round(float(s), 5), seen=round(float(n), 3))
            for g, f, s, n in sorted(sizes, key=lambda row: row[0])
        ]
        said = {"schema": "edbb-fleet/1", "robot": self.robot, "robots": len(self.robots)}
        return FleetFile.model_validate(with_hashes(said | {"sizes": [row.model_dump() for row in rows]}))

    def misfits(self) -> tuple[Misfit, ...]:
        """Return robots whose errors of a group are too large for the others, each judged by a fleet without it."""
        if len(self.robots) < 3:  # of two nobody knows which is odd
            return ()
        out = []
        for k, robot in enumerate(self.robots):
            others = Fleet.of(self.robot, [r for j, r in enumerate(self.robots) if j != k])
            out += list(misfits_of(robot, others.file()))
        return tuple(out)


def read_robot(path: Path) -> tuple[str, RobotErrors, tuple[HandEdit, ...]]:
    """Read a robot of the fleet: its record, of which the last calibration counts, or the folder of an identification.

    Returns:
        The kind of robot, its errors, and what a person changed in its file.

    Raises:
        InputError: neither, or no calibration.
    """
    if (path / RECORD).is_file():
        serial = read_toml(path / RECORD, RecordFile).serial
        calibrations = [e for e in RobotRecord.read(path).valid_entries if e.file.kind == "calibration"]
        if not calibrations:
            raise InputError(f"{path}: the record of {serial} has no calibration")
        folder = next((path / "entries").glob(f"{calibrations[-1].number:04d}-*"))
        name = serial
    else:
        folder, name = path, path.name
    if not (folder / IDENTIFICATION).is_file():
        raise InputError(f"{path}: is neither a record nor a folder that 'edbb identify' wrote with its {ROBOT}")
    document = Identification.read_usable(folder / IDENTIFICATION)
    if not (folder / ROBOT).is_file():
        raise InputError(f"{path}: the folder that 'edbb identify' wrote has lost its {ROBOT}")
    robot = load_robot(folder / ROBOT)
    return document.robot, RobotErrors.of(name, document, robot), robot.hand_edits


def read_robots(paths: Sequence[Path]) -> Fleet:
    """Read the robots of a fleet and estimate the sizes of their errors.

    Raises:
        InputError: a robot of another kind, one that is given twice (as a copy, too), or one alone.
    """
    resolved = [p.resolve() for p in paths]
    found: list[tuple[str, RobotErrors]] = []
    edits: list[HandEdit] = []
    for k, path in enumerate(paths):
        if resolved[k] in resolved[:k]:
            raise InputError(f"{path} is given twice: a robot counts once")
        kind, errors, edited = read_robot(path)
        edits += edited
        if found and kind != found[0][0]:
            raise InputError(f"{path}: is a '{kind}', but {paths[0]} is a '{found[0][0]}': a fleet is of one kind")
        for other, (_, known) in zip(paths, found, strict=False):
            if known.is_copy_of(errors):
                raise InputError(
                    f"{path}: holds the same calibration as {other}, number for number: a robot counts once"
                )
        if errors.name in [e.name for _, e in found]:
            errors = RobotErrors(str(path), errors.groups, errors.value, errors.std)
        found.append((kind, errors))
    fleet = Fleet.of(found[0][0] if found else "", [errors for _, errors in found])
    return replace(fleet, hand_edits=tuple(edits))


@dataclass(frozen=True, repr=False)
class FleetResult(Result):
    """The sizes of a fleet's errors; ``write`` takes the path of ``fleet.toml``.

    Attributes:
        fleet: size of each error of this kind of robot [m or rad], with its uncertainty.

    Example:
        >>> fleet(["calibrated", "other"]).write("fleet.toml")  # doctest: +SKIP
    """

    fleet: Fleet

    def overview(self) -> Summary:
        """Return the overview: errors larger or smaller than usual, and robots that do not fit."""
        sizes = sorted(self.fleet.file().sizes, key=lambda s: -_times_off(s))
        # 1.5: times larger or smaller than usual, from where the screen says a size
        notable = [s for s in sizes if _times_off(s) >= 1.5]
        facts = [("" if k else "not as usual", _words(s)) for k, s in enumerate(notable[:8])]
        odd = self.fleet.misfits()
        facts += [("" if k else "odd", m.sentence) for k, m in enumerate(odd)]
        if odd:
            names = ", ".join(dict.fromkeys(m.name for m in odd))
            facts.append(
                ("", f"the sizes count {names} too; if it was damaged, or is built otherwise, give the others alone")
            )
        details = [("" if k else "sizes", _words(s)) for k, s in enumerate(self.fleet.file().sizes)]
        title = f"{len(self.fleet.robots)} robots {self.fleet.robot}: {len(sizes)} sizes of errors"
        return Summary(title, facts or [("sizes", "all about as usual")], details)

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robots that it is made of."""
        return self.fleet.hand_edits

    def content(self) -> Mapping[str, Any]:
        """Return what ``fleet.toml`` says."""
        return self.fleet.file().model_dump(mode="json", by_alias=True)

    def text(self) -> str:
        """Return the text of ``fleet.toml``."""
        remarks = "".join(f"# {edit.remark}\n" for edit in self.fleet.hand_edits)
        return remarks + tomli_w.dumps(dict(self.content()))

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write ``fleet.toml``; return its path."""
        path = Path(folder)
        write_text(path, self.text(), force=force)
        return [path]

    def next_step(self, folder: Path) -> str:
        """Say what it is for."""
        return (
            f"edbb plan CELL --fleet {as_word(folder)} -o next plans for such a robot; "
            f"edbb identify RUN.csv --cell CELL --fleet {as_word(folder)} -o calibrated identifies it"
        )


def _times_off(size: FleetSize) -> float:
    """How far from usual a size is, as a factor either way."""
    return max(size.factor, 1 / size.factor)


def _words(size: FleetSize) -> str:
    low, high = (size.factor * times for times in (1 / (1 + size.log_std), 1 + size.log_std))
    return f"{size.group}: {size.factor:.2f} times the usual ({low:.2f} to {high:.2f}), by {size.seen:.0f} errors seen"


def fleet(records: Sequence[Path | str]) -> FleetResult:
    """Estimate how large the errors of a kind of robot are, joint by joint, with their uncertainty.

    Args:
        records: of two robots or more, their records, or folders that ``identify`` has written.

    Raises:
        InputError: one robot alone, robots of several kinds, or a folder that is neither.

    Example:
        >>> fleet(["calibrated", "other"]).write("fleet.toml")  # doctest: +SKIP
    """
    return FleetResult(read_robots([Path(r) for r in records]))
