"""Tables and figures of the log of ``tests.benchmarks.stopping``."""

import numpy as np

GOALS_MM = (0.4, 0.3, 0.2)
FIXED = ("plan", "d-optimal", "next-view")
WAYS = ("ten at a time", "batches", "batches anew", *FIXED)


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


def figures(lines):
    """Minutes of each arm by goal and way, for the picture of the pages."""
    minutes = {
        str(goal): {
            way: [
                None if (r := line["ways"][way][str(goal)])["bound"] > goal else round(float(r["minutes"]), 2)
                for line in lines
            ]
            for way in WAYS
        }
        for goal in GOALS_MM
    }
    return {"arms": len(lines), "minutes": minutes}


def coverage(lines):
    """How true what is stated is where a session stopped, by way and whether a foreign cause acts."""
    out = ["| stopped at | foreign cause | arms | stated over true | true below the bound |", "|---|---|---|---|---|"]
    for foreign in (0, 1):
        for goal in GOALS_MM:
            for way in ("ten at a time", "batches", "identified"):
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
