"""The figures of many arms: medians with their standard errors."""

import csv

import numpy as np

WORSE = 1.05  # released over geometry alone: above it the arm is counted as made worse


def write(rows, path):
    names = list(dict.fromkeys(name for row in rows for name in row))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


def _median(values, rng):
    """Median and its standard error by bootstrap."""
    values = np.asarray(values, float)
    drawn = rng.choice(values, (500, len(values)))
    return float(np.median(values)), float(np.std(np.median(drawn, axis=1)))


def _column(rows, name):
    return np.array([float(row[name]) for row in rows])


def _beside_the_products(rows):
    """Median, worst and share made worse of released over the product's own geometry alone, where that was judged."""
    gain = [float(r["released_mm"]) / float(r["product_geometry_mm"]) for r in rows if r.get("product_geometry_mm")]
    if not gain:
        return "–", "–", "–"
    worse = np.mean(np.array(gain) > WORSE)
    return f"{np.median(gain):.2f}", f"{max(gain):.2f}", f"{100 * worse:.0f} %"


def _below(share, count):
    """A share of so many arms in per cent, with its standard error."""
    return f"{100 * share:.0f} ± {100 * np.sqrt(max(share * (1 - share), 1 / count) / count):.0f} %"


def line(title, rows):
    """One line of the table: ratios and errors of a group of arms."""
    done = [row for row in rows if not int(row["refused"])]
    if not done:
        return f"| {title} | {len(rows)} | {len(rows)} |" + " |" * 13
    rng = np.random.default_rng(0)
    released, geometry = _column(done, "released_mm"), _column(done, "geometry_mm")
    ratio, gain = _column(done, "stated_mm") / released, released / geometry
    middle, error = _median(ratio, rng)
    better, its_error = _median(gain, rng)
    cells = [
        title, len(rows), len(rows) - len(done), f"{np.median(_column(done, 'nominal_mm')):.3f}",
        f"{np.median(geometry):.3f}", f"{np.median(released):.3f}", f"{middle:.2f} ± {error:.2f}",
        f"{np.quantile(ratio, 0.1):.2f} … {np.quantile(ratio, 0.9):.2f}", _below(np.mean(ratio > 1), len(ratio)),
        f"{100 * np.mean(released <= _column(done, 'bound_mm')):.0f} %", f"{better:.2f} ± {its_error:.2f}",
        f"{gain.max():.2f}", f"{100 * np.mean(gain > WORSE):.0f} %", *_beside_the_products(done),
    ]  # fmt: skip
    return "| " + " | ".join(str(c) for c in cells) + " |"


HEAD = (
    "| arms | n | refused | nominal mm | own geometry mm | released mm | stated/true | tenths of stated/true "
    "| true below stated | in 95 % | released/own geometry | worst | worse by 5 % | released/product's geometry "
    "| worst | worse by 5 % |\n" + "|---" * 16 + "|"
)


def names_line(title, rows):
    done = [row for row in rows if not int(row["refused"])]
    counted = ("true", "right", "rival", "wrong", "found", "doubtful", "asserted", "listed_wrong")
    true, right, rival, *rest = (sum(int(row.get(k) or 0) for row in done) for k in counted)
    return "| " + " | ".join(map(str, (title, len(done), true, right, rival, true - right - rival, *rest))) + " |"


NAMES_HEAD = (
    "| arms | n | hidden | named | named as a rival | not named | wrong without rival | findings | doubtful | "
    "called found | wrong as listed |\n" + "|---" * 11 + "|"
)


def groups(rows):
    for gauge in dict.fromkeys(row["gauge"] for row in rows):
        for foreign in (0, 1):
            some = [r for r in rows if r["gauge"] == gauge and int(r["foreign"]) == foreign]
            if not some:
                continue
            title = f"{gauge}{', one foreign' if foreign else ''}"
            yield f"{title}, all", some
            for count in sorted({int(r["causes"]) for r in some}):
                yield f"{title}, {count} causes", [r for r in some if int(r["causes"]) == count]


def text(rows):
    """Both tables, in Markdown."""
    all_groups = list(groups(rows))
    return "\n".join([
        HEAD, *(line(*group) for group in all_groups), "", NAMES_HEAD, *(names_line(*group) for group in all_groups),
    ])  # fmt: skip
