"""Which runs the table is made of; even seeds are for building, odd ones for the table alone."""

from collections.abc import Iterator

from tests.blind.trial import Task
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.draw import shown_by

NJ, KR = "comau-nj130", "kuka-kr6-r700"
BENCH = (("edbb", NJ), ("moving", NJ), ("tracker", KR), ("balls", KR))
SHARES = (3.0, 1.0)
PARTS = ("single", "arm", "clean", "outside")
BLOCK = 10_000  # seeds of one part


def tasks(
    part: str, count: int, table: bool, gauges: tuple[str, ...] = (), kinds: tuple[str, ...] = (), skip: int = 0
) -> list[Task]:
    """Return ``count`` tasks of a part, spread evenly over gauges, kinds, shares or noises; ``skip`` seeds are left."""
    rows = [t for t in _turns(part) if (not gauges or t[0] in gauges) and (not kinds or t[2] in kinds)]
    first = BLOCK * PARTS.index(part) + 2 * skip + int(table)
    few = count < len(rows)
    return [Task(part, *rows[k * len(rows) // count if few else k % len(rows)], first + 2 * k) for k in range(count)]


def _turns(part: str) -> list[tuple[str, str, str, float, str]]:
    """Gauge, arm, kind, share and noise of the tasks in turn, all gauges mixed so that a few tasks see them all."""
    if part == "arm":
        return [("edbb", NJ, "arm", 3.0, "white")]
    if part == "clean":
        return [(g, a, "", 0.0, noise) for noise in ("white", "heavy", "correlated") for g, a in BENCH]
    by_gauge = [list(_kinds(part, gauge, arm)) for gauge, arm in BENCH]
    most = max(map(len, by_gauge))
    mixed = [rows[k % len(rows)] for k in range(most) for rows in by_gauge if k < len(rows)]
    return [row for share in SHARES for row in ((*r[:3], share, r[4]) for r in mixed)]


def _kinds(part: str, gauge: str, arm: str) -> Iterator[tuple[str, str, str, float, str]]:
    names = shown_by({"moving": "edbb"}.get(gauge, gauge), gauge == "moving", part == "single")
    for name in names:
        if KINDS[name].places(Arm.from_toml(arm)):
            yield gauge, arm, name, 0.0, "white"
