"""Traces of controllers and gauges into one run, by a column map."""

from collections.abc import Sequence
from pathlib import Path

from planner.errors import InputError
from planner.run.loading import run_of
from planner.run.map_file import MapFile
from planner.run.pairing import paired
from planner.run.table import Table, read_table
from planner.run.traces import read_trace
from planner.run.types import Run
from planner.schema import read_toml


def import_run(traces: Sequence[Path], map_file: Path) -> Run:
    """Return the run that ``traces`` hold, read by the column map (schema ``edbb-map/1``).

    The map's top level reads the first trace, its ``[[traces]]`` the further ones in their order; a trace that the map
    says nothing of is read in the columns of a run. The gauge's trace and the controller's are joined by time, or pose
    by pose where they have no time.

    Raises:
        InputError: the map or a trace is wrong, with file, line and column.
    """
    mapping = read_toml(Path(map_file), MapFile)
    if not traces:
        raise InputError(f"no trace was given; {map_file} reads {len(mapping.all_traces)}")
    if len(traces) < len(mapping.all_traces):
        raise InputError(f"{map_file} reads {len(mapping.all_traces)} traces, but {len(traces)} were given")
    said = (("measure", mapping.measure), ("robot", mapping.robot), ("plan_id", mapping.plan_id))
    notes = tuple((key, value) for key, value in said if value is not None)
    n_joints = mapping.n_joints
    tables: list[Table] = []
    for i, path in enumerate(traces):
        known = i < len(mapping.all_traces)
        tables.append(
            read_trace(Path(path), mapping.all_traces[i], notes) if known else read_table(Path(path), n_joints or 16)
        )
    whole = paired(tables)
    if len(whole) > 1:
        files = ", ".join(t.source.file for t in whole)
        raise InputError(f"{files} are several runs, each whole; import them one by one")
    return run_of(whole[0], n_joints or max(t.n_joints for t in tables))
