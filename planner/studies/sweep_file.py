"""``SWEEP.toml``: cells, numbers of poses and values of keys of the cell file; every combination is a point."""

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from planner.cell.file import CellFile
from planner.cell.reading import cell_file_of
from planner.common.choices import IndexName
from planner.common.errors import InputError
from planner.common.files import INPUTS
from planner.common.schema import StrictModel
from planner.kinematics.bodies import Vector

Changes = tuple[tuple[str, Any], ...]
"""Keys of the cell file, as ``gauge.noise_um``, with the values that stand in their place."""

SCHEMA = "edbb-sweep/1"
SHORT = {"fixtures_mm": "fixtures.position_mm", "bars_mm": "gauge.length_mm", "tools_mm": "tool.map_mm"}
OTHER_KEYS = {"plan.poses": "'poses'", "plan.candidates": "'candidates'", "robot": "'cells'", "schema": "'schema'"}


class SweepFile(StrictModel):
    """The whole file; what is left out stays as the cell has it.

    Attributes:
        cells: shipped ones, or paths from the folder of the file.
        poses: how many are measured.
        fixtures_mm: places of the first fixture, or lists of places: so many fixtures stand there.
        bars_mm, tools_mm: shortest and longest reading; tool points.
        axes: values of any other key of the cell file, by its name: ``"gauge.noise_um" = [2, 10]``.
        index: by which poses are chosen; the cell's where it is left out.
        trials: arms at each point, the same at all of them.
        candidates, seed: of poses; of arms and poses.
    """

    schema_: Literal["edbb-sweep/1"] = Field(alias="schema")
    cells: Annotated[tuple[str, ...], Field(min_length=1)]
    poses: Annotated[tuple[Annotated[int, Field(ge=4, le=1000)], ...], Field(min_length=1)]
    fixtures_mm: tuple[Vector | tuple[Vector, ...], ...] = ()
    bars_mm: tuple[tuple[float, float], ...] = ()
    tools_mm: tuple[Vector, ...] = ()
    axes: dict[str, Annotated[tuple[Any, ...], Field(min_length=1)]] = {}
    index: IndexName | None = None
    trials: Annotated[int, Field(ge=1, le=100_000)] = 200
    candidates: Annotated[int, Field(ge=100, le=100_000)] = 800
    seed: Annotated[int, Field(ge=0)] = 0

    def named_cells(self, folder: Path) -> list[str]:
        """Return the cells as they are loaded: shipped ones by name, others by their whole path."""
        paths = [(folder / c).resolve() for c in self.cells]
        there = [INPUTS.allows(p) and p.is_file() for p in paths]
        return [str(p) if is_file else c for c, p, is_file in zip(self.cells, paths, there, strict=True)]

    @property
    def all_axes(self) -> dict[str, tuple[Any, ...]]:
        """The axes beside cells and poses, those with short names first."""
        short = {key: values for name, key in SHORT.items() if (values := getattr(self, name))}
        return short | self.axes

    def points(self, cells: Sequence[str]) -> Iterator[tuple[str, int, Changes]]:
        """Yield every combination of cell, number of poses and changes, in order."""
        keys, values = list(self.all_axes), list(self.all_axes.values())
        for cell, poses, *change in product(cells, self.poses, *values):
            yield cell, poses, tuple(zip(keys, change, strict=True))

    def check(self, where: str) -> None:
        """Refuse axes that have a key of their own, and axes and an index that say the same.

        Raises:
            InputError: naming the key.
        """
        for key in self.axes:
            own = OTHER_KEYS.get(key) or next((f"'{name}'" for name, k in SHORT.items() if k == key), None)
            if own:
                raise InputError(f"{where}: 'axes.{key}' is given by the key {own} of the sweep: write it there")
        if self.index is not None and "plan.index" in self.axes:
            raise InputError(f"{where}: the index is given ({self.index}), and 'axes' has plan.index: leave one out")


def changed_file(file: CellFile, changes: Changes, candidates: int, where: str) -> CellFile:
    """Return a cell file with other values; mount poses are left open, as they may not fit any more.

    A key of a table that may be repeated, as ``fixtures.prior_mm``, is that of the first one.

    Raises:
        InputError: there is no such key, or the value does not fit.
    """
    content = file.model_dump(mode="json", by_alias=True)
    for key, value in changes:
        _set_key(content, key, value, where)
    for table in (content["gauge"], *content["fixtures"]):
        table["mount_deg"], table["mount_mm"] = None, ()
    content["plan"]["candidates"] = candidates
    return cell_file_of(content, f"{where} with {describe_changes(changes)}" if changes else where)


def _set_key(content: dict[str, Any], key: str, value: Any, where: str) -> None:
    if key == SHORT["fixtures_mm"] and isinstance(value[0], Sequence):
        first = (content["fixtures"] or [{}])[0]
        alike = {k: v for k, v in first.items() if k not in ("name", "position_mm")}
        content["fixtures"] = [{"name": chr(ord("A") + k), "position_mm": p, **alike} for k, p in enumerate(value)]
        return
    if key == "gauge":
        content["motion"].pop("measure", None)  # as is usual for the gauge
    *tables, last = key.split(".")
    inner: Any = content
    for name in tables:
        inner = inner.get(name) if isinstance(inner, Mapping) else None
        inner = inner[0] if isinstance(inner, list | tuple) and inner else inner
    if not isinstance(inner, dict):
        raise InputError(f"{where}: has no [{'.'.join(tables)}], which the axis {key} changes")
    inner[last] = value


def describe_changes(changes: Changes) -> str:
    """Return changes as a person reads them."""
    return ", ".join(f"{key} = {column_value(value)}" for key, value in changes)


def column_value(value: Any) -> int | float | str:
    """Return a value of an axis as it stands in a column: numbers as they are, all else as text."""
    return value if isinstance(value, int | float | str) and not isinstance(value, bool) else json.dumps(value)
