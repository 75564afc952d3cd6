"""What a person may ask of a plan, and what of it does not go together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from planner.cell.declared import FleetOption
from planner.common.calls import Dialects, JobFile, Option, Seed, call_fields, upload_option
from planner.common.choices import Aim, IndexName, SelectionMethod, TourOrder, TourSolver
from planner.common.errors import DeclarationError, InputError, did_you_mean

if TYPE_CHECKING:
    from pydantic import BaseModel

    from planner.cell.cell import Cell


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """What a person may ask of the planning; ``None`` leaves it to the cell."""

    poses: Annotated[
        int | None, Option("number of poses (default: where more hardly help)", min=1, max_served=1000)
    ] = None
    index: Annotated[IndexName | None, Option("observability index to select by")] = None
    seed: Seed = 0
    dialect: Dialects = ()
    tsp: Annotated[TourSolver, Option("tour solver")] = "auto"
    separate: Annotated[
        Path | str | None,
        Option(
            "the calibrated robot: choose poses that tell its findings from their rivals",
            typed=Path | None,
            metavar="CALIBRATED",
            from_service=JobFile("identification", "before", "identification.json"),
        ),
    ] = None
    fixtures: Annotated[
        int | None, Option("fixtures in all: good places are found for those after the first", min=1, max=6)
    ] = None
    aim: Annotated[
        Aim | None, Option("poses by the index, or by the error that is left once hidden effects are traced")
    ] = None
    method: Annotated[
        SelectionMethod | None,
        Option("how the index selects: by exchange (default), or one pose at a time taken away (EDBB paper)"),
    ] = None
    order: Annotated[
        TourOrder | None,
        Option("order of the poses: by each segment's slowest limit (default), or axis", motion_key=True),
    ] = None
    as_published: Annotated[
        bool, Option("every stage as in the EDBB paper: pruning by O2, order by the slowest axis, G-code and KRL")
    ] = False
    laps: Annotated[
        int | None,
        Option(
            "laps of the tour (default 1), each through the whole workspace, the poses that tell most in the first: for"
            " sessions that may end before the last pose",
            min=1,
            max=4,
        ),
    ] = None

    after: Annotated[
        Path | str | Sequence[Path | str] | None,
        Option(
            "the calibrated robot, by all runs so far: poses that lower the error that it leaves most",
            typed=list[Path] | None,
            metavar="CALIBRATED",
            from_service=JobFile("identification", "calibrated"),
        ),
    ] = None
    same_mounting: Annotated[
        bool, Option("with --after: the gauge was left standing; its place and zero are as the last run found")
    ] = False
    until_mm: Annotated[
        float | None,
        Option(
            "as many poses as bring the error over the workspace (rms) down to this, 95 % sure",
            min=0.001,
            max=10.0,
            max_served=10.0,
            metavar="MM",
        ),
    ] = None

    region: Annotated[
        Path | str | None,
        upload_option(
            "with --after: the box of the workspace in which the error counts (lower_mm, upper_mm in the base frame)",
            "BOX.toml",
        ),
    ] = None
    program: Annotated[
        Path | str | None,
        upload_option(
            "with --after: the program (or table of targets) at whose targets the error counts, with its tools",
            "PROGRAM",
        ),
    ] = None
    fleet: FleetOption = None

    @property
    def folder_before(self) -> Path | None:
        """The folder of ``after``.

        Raises:
            InputError: there are several: sizes of errors, which all runs share, are learnt from all of them together.
        """
        if self.after is None or isinstance(self.after, Path | str):
            return None if self.after is None else Path(self.after)
        folders = list(dict.fromkeys(Path(f) for f in self.after))
        if len(folders) > 1:
            raise InputError(
                f"--after {' --after '.join(map(str, folders))}: one calibration of all runs is needed, as they tell "
                "together how large each error is: identify them as one first (edbb identify RUN1 RUN2 -o known, each "
                "run in its plan's folder), then plan with --after known"
            )
        return folders[0] if folders else None

    def in_motion(self, cell: "Cell") -> "Cell":
        """Return the cell with what is asked in place of keys of ``[motion]``, in its file as well.

        Raises:
            DeclarationError: a field with ``motion_key`` has the name of no key there.
        """
        from planner.cell.reading import read_motion

        names = motion_keys(type(self), type(cell.file.motion))
        asked = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        if not asked:
            return cell
        file = cell.file.model_copy(update={"motion": cell.file.motion.model_copy(update=asked)})
        return replace(cell, file=file, motion=read_motion(file))

    def aims_at_tracing(self, cell: "Cell") -> bool:
        """Tell whether the poses are to show what nobody has declared: where nothing else is asked for, they are.

        Raises:
            InputError: they are to tell rivals apart as well, or an index is to select them by some method.
        """
        if self._for_what_remains(cell):
            return True
        asked = self.aim or self.method
        aim, method = (self.aim, self.method) if asked else (cell.plan.aim, cell.plan.method)
        if self.separate and self.method:
            raise InputError(f"{cell.path}: --separate chooses the poses, and so does --method: leave one out")
        if aim is None:
            return not (self.separate or self.index or method)
        wanted = aim == "tracing"
        if wanted and method:
            raise InputError(
                f"{cell.path}: the method '{method}' chooses the poses by an index, the aim 'tracing' by the error "
                "that is left: leave one out"
            )
        if wanted and self.separate:
            raise InputError(f"{cell.path}: --separate chooses the poses, and so does the aim 'tracing': leave one out")
        return wanted

    def _for_what_remains(self, cell: "Cell") -> bool:
        """Tell whether the error that is left chooses the poses because of ``--after`` or ``--until-mm``.

        Raises:
            InputError: something else is asked for as well.
        """
        if self.same_mounting and self.after is None:
            raise InputError(f"{cell.path}: --same-mounting goes with --after, whose run has left the gauge standing")
        counts = [f"--{name}" for name in ("region", "program") if getattr(self, name) is not None]
        if counts and self.after is None:
            raise InputError(
                f"{cell.path}: {counts[0]} goes with --after: of a robot of which nothing is known all errors count"
            )
        if len(counts) > 1:
            raise InputError(f"{cell.path}: both --region and --program say where the error counts: leave one out")
        name = "--after" if self.after else "--until-mm" if self.until_mm is not None else ""
        if not name:
            return False
        others: dict[str, object] = {"--separate": self.separate, "--index": self.index, "--method": self.method}
        others |= {"--poses": self.poses if self.until_mm is not None else None}
        others |= {"--aim index": self.aim if self.aim != "tracing" else None}
        if given := [k for k, v in others.items() if v is not None]:
            why = "it says how many poses" if given[0] == "--poses" else "the error that is left chooses the poses"
            raise InputError(f"{cell.path}: {name} does not go together with {given[0]} ({why}): leave one out")
        return True


def motion_keys(options: type[PlanOptions], section: type["BaseModel"]) -> list[str]:
    """Return the fields that stand for keys of ``section``, that of ``[motion]``.

    Raises:
        DeclarationError: it has no key of such a name.
    """
    known = list(section.model_fields)
    names = [f.name for f in call_fields(options) if f.option.motion_key]
    if unknown := [name for name in names if name not in known]:
        raise DeclarationError(
            f"{options.__module__}: {options.__name__}.{unknown[0]}: motion_key=True, but [motion] has no such "
            f"key{did_you_mean(unknown[0], known)} (there: {', '.join(known)})"
        )
    return names


def check_point_options(cell: "Cell", options: PlanOptions) -> None:
    """Check that nothing is asked of a plan for balls or a tracker that only the poses of a bar can give.

    Raises:
        InputError: with the option to leave out.
    """
    if cell.gauge.at_balls and (options.method or cell.plan.method) == "pruning":
        raise InputError(
            f"{cell.path}: pruning keeps the poses of any ball, and each ball is to have as many: leave the method out"
        )
    here = f"the gauge here is '{cell.gauge.kind}'; leave it out"
    if options.fixtures is not None:
        raise InputError(f"{cell.path}: --fixtures is for a bar, {here}")
    if (options.aim or cell.plan.aim) == "tracing":
        raise InputError(f"{cell.path}: the aim 'tracing' is for a bar, {here}")
    for name, value in (("--after", options.after), ("--until-mm", options.until_mm)):
        if value is not None:
            raise InputError(f"{cell.path}: {name} chooses the poses of a bar or a wire, {here}")
    if options.separate is not None:
        raise InputError(
            f"{cell.path}: --separate chooses the poses of a bar, {here}, "
            "or measure with a bar what the identification left open"
        )
