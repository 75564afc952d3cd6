"""The table: how often effects are named, what is invented, and how the errors compare with an oracle's."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from tests.blind.trial import Outcome

WRONG = ("the run is no likelier with it than chance would have it among so many",)


def table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of the table."""
    made = [o for o in outcomes if not o.failed]
    lost = [o for o in outcomes if o.failed]
    yield f"{len(outcomes)} runs, {len(lost)} of them could not be made or fitted"
    for why, many in Counter(o.failed.split(":")[0] for o in lost).most_common():
        yield f"    {many:4d} {why}"
    for part in ("single", "outside"):
        for share in (3.0, 1.0):
            rows = [o for o in made if o.task.part == part and o.task.share == share]
            if rows:
                yield from _named(f"{part} at {share:g} x noise", rows, part == "outside")
    yield from _arm([o for o in made if o.task.part == "arm"])
    yield from _clean([o for o in made if o.task.part == "clean"])
    yield from _errors(made)
    single = [o for o in made if o.task.part in ("single", "outside")]
    if single:
        yield from _kinds(single)
        yield from _confusion(single)


def _named(title: str, rows: list[Outcome], outside: bool) -> Iterator[str]:
    hit = sum(o.all_named for o in rows)
    alone = sum(all(p.named for p in o.planted) for o in rows)
    false = sum(o.invented > 0 for o in rows)
    silent = sum(not o.named for o in rows)
    rivals = np.mean([len(n.rivals) for o in rows for n in o.named] or [0])
    yield (
        f"{title}: {_share(hit, len(rows))} named ({_share(alone, len(rows))} first of all), "
        f"{_share(false, len(rows))} with a name that is wrong, {_share(silent, len(rows))} nothing said; "
        f"rivals a finding {rivals:.1f}"
    )
    if outside:
        reached = [_reached(o) for o in rows if o.oracle_geometry > 1.03 * o.oracle]
        yield f"    of the oracle's gain: median {np.median(reached):.2f}, half or more in {_mean(reached)}"


def _mean(reached: list[float]) -> str:
    return _share(sum(r >= 0.5 for r in reached), len(reached))


def _reached(o: Outcome) -> float:
    """Share of the oracle's gain."""
    return (o.geometry - o.held_out) / (o.geometry - o.oracle)


def _arm(rows: list[Outcome]) -> Iterator[str]:
    if not rows:
        return
    planted = [p for o in rows for p in o.planted]
    names = [n for o in rows for n in o.named]
    found = sum(p.named or p.as_rival for p in planted)
    yield (
        f"several at once: {len(rows)} runs, found {_share(found, len(planted))}, "
        f"first of all {_share(sum(p.named for p in planted), len(planted))}, "
        f"invented {_share(sum(not n.right for n in names), len(names))} of the names"
    )
    for kind in sorted({p.kind for p in planted}):
        of = [p for p in planted if p.kind == kind]
        yield f"    {kind:20s} {_share(sum(p.named or p.as_rival for p in of), len(of))}"
    for name, many in Counter(f"{n.effect}, {n.on}" for n in names if not n.right).most_common():
        yield f"    invented {many} {name}"


def _clean(rows: list[Outcome]) -> Iterator[str]:
    for noise in ("white", "heavy", "correlated"):
        of = [o for o in rows if o.task.noise == noise]
        if of:
            added = Counter(f"{o.task.gauge}: {n.effect}, {n.on}" for o in of for n in o.named)
            yield f"clean, {noise}: added to {_share(sum(bool(o.named) for o in of), len(of))} {dict(added)}"
    if rows:
        yield f"clean, all: added to {_share(sum(bool(o.named) for o in rows), len(rows))}"


def _errors(rows: list[Outcome]) -> Iterator[str]:
    for part in ("single", "arm", "clean", "outside"):
        ratio = [o.held_out / o.oracle - 1 for o in rows if o.task.part == part]
        if ratio:
            yield (
                f"held-out error over the oracle's, {part}: median {100 * np.median(ratio):+.1f} %, "
                f"95th percentile {100 * np.percentile(ratio, 95):+.1f} %"
            )
    spent = [o.seconds for o in rows]
    yield f"processor seconds a run: median {np.median(spent):.1f}, largest {np.max(spent):.1f}"


def _kinds(rows: list[Outcome]) -> Iterator[str]:
    by = defaultdict(list)
    for o in rows:
        by[o.task.kind].append(o)
    yield "kind                  named   of  invented  by gauge (named of runs)"
    for kind, of in sorted(by.items()):
        gauges = defaultdict(list)
        for o in of:
            gauges[f"{o.task.gauge} {o.task.share:g}x"].append(o.all_named)
        each = ", ".join(f"{g} {sum(v)}/{len(v)}" for g, v in sorted(gauges.items()))
        yield f"{kind:20s} {sum(o.all_named for o in of):6d} {len(of):4d} {sum(o.invented for o in of):9d}  {each}"


def _confusion(rows: list[Outcome]) -> Iterator[str]:
    """Every planted kind with what was said: the first name given, its joint right or not."""
    yield "confusion: planted -> first names given"
    by = defaultdict(Counter)
    for o in rows:
        for p in o.planted:
            said = sorted(o.named, key=lambda n: n.log_p)[:1]
            for n in said:
                by[p.kind][
                    n.effect + ("" if n.right else " (wrong)") + ("" if p.named or not n.right else " (rival)")
                ] += 1
            if not said:
                by[p.kind]["-"] += 1
    for kind, said in sorted(by.items()):
        yield f"    {kind:20s} " + "; ".join(f"{name} {many}" for name, many in said.most_common())


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole} = {100 * part / max(whole, 1):.1f} %"
