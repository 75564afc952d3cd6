"""Which files are whole runs, and which are the two halves of one: the gauge's log and the controller's."""

from collections.abc import Sequence

from planner.errors import InputError
from planner.run.reading import has_reading
from planner.run.synchronise import synchronised
from planner.run.table import Table


def paired(tables: Sequence[Table]) -> list[Table]:
    """Return whole tables in their order, a gauge's log joined with the controller's that is given with it.

    The first log without angles goes with the first without a reading, the second with the second.

    Raises:
        InputError: a half has no partner, or the two cannot be joined.
    """
    gauges = [t for t in tables if has_reading(t) and not t.n_joints]
    axes = [t for t in tables if t.n_joints and not has_reading(t)]
    if not gauges or not axes:
        return list(tables)  # what is missing in them is said where the run is made
    if len(gauges) != len(axes):
        raise InputError(
            f"{', '.join(t.source.file for t in gauges)}: readings without joint angles; "
            f"{', '.join(t.source.file for t in axes)}: joint angles without readings; "
            "each of the one needs one of the other"
        )
    partner = dict(zip((t.source.file for t in gauges), axes, strict=True))
    alone = {t.source.file for t in axes}
    return [
        synchronised(t, partner[t.source.file]) if t.source.file in partner else t
        for t in tables
        if t.source.file not in alone
    ]
