"""Plans of other kinds than poses, which extensions make and read."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from planner.common.errors import InputError
from planner.common.extensions import load_extensions

if TYPE_CHECKING:
    from planner.cell.cell import Cell
    from planner.common.progress import Stages
    from planner.runs.run import Samples
    from planner.session.options import PlanOptions
    from planner.session.plan_types import Course
    from planner.workflow.plan_results import SessionResult


class DrivenPlan(Protocol):
    """A plan of another kind, as it is driven; a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def cell(self) -> "Cell":
        """The cell that the plan is for."""

    @property
    def courses(self) -> "Sequence[Course]":
        """The courses that the plan drives."""

    @property
    def plan_id(self) -> str:
        """Hash of its content."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person must know of it."""


class PlanMaker(Protocol):
    """What plans and reads plans of one kind."""

    def plan(self, cell: "Cell", options: "PlanOptions", stages: "Stages") -> "SessionResult":
        """Plan a cell."""

    def load(self, path: Path) -> DrivenPlan:
        """Read a plan with the cell beside it, as it is driven."""

    def samples(self, plan: DrivenPlan, rate: float) -> "Samples":
        """Return where the arm is told to stand, ``rate`` times a second."""


@dataclass(frozen=True)
class PlanKind:
    """A kind of plan beside that of poses.

    Attributes:
        name: ``kind`` in ``plan.json``.
        table: the table of a cell file whose entries are planned so.
        maker: its :class:`PlanMaker` as ``module:name``; it is imported when such a plan is made or read.
    """

    name: str
    table: str
    maker: str

    def load_maker(self) -> PlanMaker:
        """Import what plans and reads it."""
        module, name = self.maker.split(":")
        made: PlanMaker = getattr(import_module(module), name)()
        return made


_KINDS: dict[str, PlanKind] = {}


def register_plan_kind(kind: PlanKind) -> None:
    """Make a kind of plan known."""
    _KINDS[kind.name] = kind


def find_plan_kind(name: str, path: Path) -> PlanKind:
    """Return the kind of the plan at ``path``.

    Raises:
        InputError: no extension that is installed here reads it.
    """
    load_extensions()
    if name not in _KINDS:
        raise InputError(f"{path}: is a plan of the kind '{name}', and no extension that is installed here reads it")
    return _KINDS[name]


def kind_of_cell(cell: "Cell") -> PlanKind | None:
    """Return the kind of plan that a cell asks for beside poses, if any.

    Raises:
        InputError: no extension that is installed here plans what its file has in place of poses.
    """
    load_extensions()
    for kind in _KINDS.values():
        if kind.table in cell.sections:
            return kind
    for key, content in cell.sections.items():
        if content.replaces_poses:
            raise InputError(f"{cell.path}: no extension that is installed here plans [[{key}]]")
    return None
