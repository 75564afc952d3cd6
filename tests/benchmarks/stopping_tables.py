"""Tables and figures of the log of ``tests.benchmarks.stopping``."""

import numpy as np

GOALS_MM = (0.4, 0.3, 0.2)
OWN = "plan's own number"
FIXED = ("plan", "by the minute", "d-optimal", "next-view set")
SEQUENTIAL = ("led on", "measure", "batches", "batches anew", "next-view")
WAYS = (*SEQUENTIAL, *FIXED, OWN, "oracle")


def quantile(values, share):
    return float(np.sort(values)[int(np.ceil(share * len(values))) - 1])


def table(lines):
    """Minutes to each goal by way: median and 90 % over arms, how many reach it, how true what is stated is."""
    out = [
        "| bound | way | arms that reach it | minutes, median | minutes, 90 % | stated over true | true below |",
        "|---|---|---|---|---|---|---|",
    ]
    for goal in GOALS_MM:
        for way in WAYS:
            own = [line["ways"][way][str(goal)] for line in lines if way in line["ways"]]
            hit = [r for r in own if r["bound"] <= goal]
            if not own:
                continue
            minutes = [*(r["minutes"] for r in hit), *[np.inf] * (len(own) - len(hit))]
            said = [f"{m:.0f}" if np.isfinite(m := quantile(minutes, s)) else "not reached" for s in (0.5, 0.9)]
            ratio = f"{np.median([r['stated'] / r['true'] for r in hit]):.2f}" if hit else "–"
            below = f"{sum(r['true'] <= r['bound'] for r in hit)} of {len(hit)}"
            out.append(f"| {goal} mm | {way} | {len(hit)} of {len(own)} | {said[0]} | {said[1]} | {ratio} | {below} |")
    return "\n".join(out)


def best(lines):
    """What 250 poses state: the least, the median and the most over arms."""
    bounds = [line["best"] for line in lines if "best" in line]
    if not bounds:
        return ""
    return f"250 poses: {min(bounds):.3f} to {max(bounds):.3f} mm, median {np.median(bounds):.3f} mm"


def equal_truth(lines):
    """Against sets of one number for all arms: the fewest poses whose true error is as small (to 5 %), median and 90 %.

    Beside it the minutes with which as many of the arms state a bound below the goal.
    """
    out = [
        "| bound | way | minutes, median | true, mm: median, 90 % | against | poses | minutes, same truth | less |"
        " minutes, same bound | less |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for goal in GOALS_MM:
        for way in SEQUENTIAL:
            own = [line["ways"][way][str(goal)] for line in lines if way in line["ways"]]
            if not own:
                continue
            hit = np.mean([r["bound"] <= goal for r in own])
            true = np.array([r["true"] for r in own])
            want = [quantile(true, 0.5), quantile(true, 0.9)]
            minutes = quantile([r["minutes"] if r["bound"] <= goal else np.inf for r in own], 0.5)
            for fixed in FIXED if np.isfinite(minutes) else ():
                rows = [line["ways"][fixed]["rows"] for line in lines if fixed in line["ways"]]
                if not rows:
                    continue
                by_number = [np.array(at) for at in zip(*rows, strict=False)]  # (arms, 4) of each number of poses
                same = [
                    at
                    for at in by_number
                    if all(quantile(at[:, 3], s) <= 1.05 * w for s, w in zip((0.5, 0.9), want, strict=True))
                ]
                stated = [at for at in by_number if np.mean(at[:, 2] <= goal) >= hit]
                said = [less(minutes, found[0][0, 1] if found else None) for found in (same, stated)]
                poses = f"{same[0][0, 0]:.0f}" if same else "–"
                out.append(
                    f"| {goal} mm | {way} | {minutes:.0f} | {want[0]:.3f}, {want[1]:.3f} | {fixed} | {poses} | "
                    f"{said[0]} | {said[1]} |"
                )
    return "\n".join(out)


def less(minutes, others):
    """Two cells of a table: the minutes of others, and how much less these are."""
    if others is None:
        return "not within 180 poses | –"
    return f"{others:.0f} | {100 * (1 - minutes / others):.0f} %"


def figures(lines):
    """Minutes of each arm by goal and way, for the picture of the pages."""
    minutes = {
        str(goal): {
            way: [
                None if (r := line["ways"][way][str(goal)])["bound"] > goal else round(float(r["minutes"]), 2)
                for line in lines
            ]
            for way in WAYS
            if all(way in line["ways"] for line in lines)
        }
        for goal in GOALS_MM
    }
    return {"arms": len(lines), "minutes": minutes}


def coverage(lines):
    """How true what is stated is where a session stopped, by way and whether a foreign cause acts."""
    out = ["| stopped at | foreign cause | arms | stated over true | true below the bound |", "|---|---|---|---|---|"]
    for foreign in (0, 1):
        for goal in GOALS_MM:
            for way in ("led on", "batches", "identified"):
                rows = [
                    line["ways"]["batches" if way == "identified" else way][str(goal)]
                    for line in lines
                    if line["seed"] % 2 == foreign and ("batches" if way == "identified" else way) in line["ways"]
                ]
                rows = [r["identified"] for r in rows if "identified" in r] if way == "identified" else rows
                if rows:
                    ratio = np.median([r["stated"] / r["true"] for r in rows])
                    below = sum(r["true"] <= r["bound"] for r in rows)
                    out.append(f"| {way}, {goal} mm | {foreign} | {len(rows)} | {ratio:.2f} | {below} of {len(rows)} |")
    return "\n".join(out)
