"""Readings that stand twice: a file that is given as two, rows that were pasted again."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.runs.run import Run


def refuse_repeated_files(files: Sequence[Path]) -> None:
    """Refuse a file that is given twice, by its own name or as a copy.

    Raises:
        InputError: naming it, and the other.
    """
    for i, file in enumerate(files):
        for other in files[:i]:
            if file.resolve() == other.resolve():
                raise InputError(f"{file} is given twice; the same samples would count as new ones")
            if _is_copy(file, other):
                raise InputError(
                    f"{file} is a copy of {other}, byte for byte; the same samples would count as new ones"
                )


def _is_copy(file: Path, other: Path) -> bool:
    fewest = 10  # lines from which on two files cannot agree by chance
    both = file.is_file() and other.is_file() and file.stat().st_size == other.stat().st_size
    return both and (found := file.read_bytes()) == other.read_bytes() and found.count(b"\n") >= fewest


def repeated_row_notes(run: Run) -> Iterator[str]:
    """Say which rows of a run at rest repeat earlier ones, joints and reading, where too many do for chance.

    A gauge that is read again at a pose shows another last digit at some of them.
    """
    values = run.readings.length if run.readings.length is not None else run.readings.position
    if run.continuous or values is None:
        return
    rows = np.column_stack([run.samples.q, values.reshape(len(run), -1), run.samples.place, run.samples.point_numbers])
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    earlier = first[which.ravel()]
    copies = np.flatnonzero(earlier < np.arange(len(run)))
    _, pose = np.unique(run.samples.q, axis=0, return_inverse=True)
    again = len(run) - len(np.unique(pose))  # rows at poses that were read before
    fewest = 5  # rows from which on it is no chance
    if len(copies) >= fewest and len(copies) == again:
        k = copies[0]
        yield (
            f"{len(copies)} rows repeat earlier ones in each digit of joints and reading, the first {run.where(k)} "
            f"that of {run.where(earlier[k])}: were they pasted twice? Each counts as a reading of its own"
        )
