"""Tables and figures of the log of ``tests.benchmarks.stopping``."""

import numpy as np

GOALS_MM = (0.4, 0.3, 0.2)
OWN = "plan's own number"
FIXED = ("plan", "by the minute", "d-optimal", "next-view set")
SEQUENTIAL = ("led on", "measure", "batches", "batches anew", "next-view")
WAYS = (*SEQUENTIAL, *FIXED, OWN, "oracle")


def quantile(values, share):
    return float(np.sort(values)[int(np.ceil(share * len(values))) - 1])


def at_goal(lines, way, goal):
    """Where the arms that were measured in this way stood at a goal [mm], and which of them reached it."""
    rows = [line["ways"][way][str(goal)] for line in lines if way in line["ways"]]
    return rows, [r for r in rows if r["bound"] <= goal]


def table(lines):
    """Minutes to each goal by way: median and 90 % over arms, one number for all, how true what is stated is."""
    out = [
        "| below | way | arms that reach it | median, min | 90 % of the arms, min | one number for all, min |"
        " stated / true | true error below the bound |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for goal in GOALS_MM:
        for way in WAYS:
            own, hit = at_goal(lines, way, goal)
            if not own:
                continue
            minutes = [*(r["minutes"] for r in hit), *[np.inf] * (len(own) - len(hit))]
            said = [f"{m:.0f}" if np.isfinite(m := quantile(minutes, s)) else "–" for s in (0.5, 0.9)]
            number = ""
            if way in FIXED:  # which number an arm needs only an oracle knows
                said, number = [f"({m})" for m in said], one_number(lines, way, goal)
            elif way == OWN:
                said, number = ["–", "–"], f"{own[0]['minutes']:.0f} ({own[0]['poses']} poses)"
            ratio = f"{np.median([r['stated'] / r['true'] for r in hit]):.2f}" if hit else "–"
            below = f"{sum(r['true'] <= r['bound'] for r in hit)} of {len(hit)}"
            reached = f"{len(hit)} of {len(own)}"
            out.append(f"| {goal} mm | {way} | {reached} | {said[0]} | {said[1]} | {number} | {ratio} | {below} |")
    return "\n".join(out)


def one_number(lines, way, goal):
    """The fewest poses with which nine tenths of the arms reach a goal that reach it by being led on; their minutes."""
    led = [
        line["ways"][way]["rows"]
        for line in lines
        if way in line["ways"] and "led on" in line["ways"] and line["ways"]["led on"][str(goal)]["bound"] <= goal
    ]
    for rows in zip(*led, strict=False):  # (poses, minutes, bound, true) of each arm, by number of poses
        if np.mean([r[2] <= goal for r in rows]) >= 0.9:
            return f"{rows[0][1]:.0f} ({rows[0][0]} poses)"
    return "more than 180 poses"


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
    """How true what is stated is where a session stopped, or ended, by way and whether a foreign cause acts."""
    out = [
        "| | catalogue: true error below the 95 % limit | and a foreign cause | together |"
        " stated / true, median: catalogue, foreign |",
        "|---|---|---|---|---|",
    ]
    asked = [(OWN, GOALS_MM[0]), *((way, goal) for way in ("led on", "batches", "identified") for goal in GOALS_MM)]
    for way, goal in asked:
        of = "batches" if way == "identified" else way
        kinds = [at_goal([line for line in lines if line["seed"] % 2 == k], of, goal)[0] for k in (0, 1)]
        if way == "identified":
            kinds = [[r["identified"] for r in rows if "identified" in r] for rows in kinds]
        if not all(kinds):
            continue
        below = [(sum(r["true"] <= r["bound"] for r in rows), len(rows)) for rows in kinds]
        both = tuple(map(sum, zip(*below, strict=True)))
        ratio = ", ".join(f"{np.median([r['stated'] / r['true'] for r in rows]):.2f}" for rows in kinds)
        name = f"one shot, {kinds[0][0]['poses']} poses" if way == OWN else f"{way} until {goal} mm"
        counts = " | ".join(f"{hit} of {count}" for hit, count in (*below, both))
        out.append(f"| {name} | {counts} | {ratio} |")
    return "\n".join(out)
