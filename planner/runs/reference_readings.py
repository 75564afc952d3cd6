"""What a run's file says above its columns of readings beside the poses: nests before a tracker's run, the master ball.

# nest_mm: N1, 1964.1, 278.2, -341.6       a nest as the tracker read it, in its own frame
# master_mm: 6.350, 6.351, 6.349           the three indicators with the master ball in its socket; once or more often
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, from_mm, read_only, to_mm

NEST, MASTER = "nest_mm", "master_mm"
DIGITS = 6  # of a millimetre, as lines are written


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
        found = np.array([float(w) for w in words])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise InputError(
            f"{path}, line {k}: '{line}' should be '# {NEST}: NAME, x, y, z' or '# {MASTER}: x, y, z', in millimetres"
        )
    return read_only(from_mm(found))


def _numbers(p: Array) -> str:
    return ", ".join(f"{v:.{DIGITS}f}" for v in to_mm(p))
