"""The page: published numbers, ours, the difference, and where a number cannot be compared and why."""

from html import escape
from pathlib import Path

import tests.reproduction.pictures as pictures
from tests.instruments.loaded.reproduction import rows as loaded_rows
from tests.instruments.loaded.reproduction import write_figures
from tests.reproduction.judge import as_planted, nominal
from tests.reproduction.table9 import PUBLISHED, SIZE, other_arms, quickest, rows
from tests.reproduction.truth import hidden

STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.25rem .7rem;border-bottom:1px solid #ddd;text-align:right}
td:first-child,th:first-child{text-align:left}img{max-width:100%}.note{color:#555}"""


def write(folder, circle, say=print):
    """Write ``index.html`` and its pictures; ``circle``: what the circular test gave."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    clean = list(rows(0.0, ((1, 1, 80, "index"),), say))
    table = list(rows(SIZE, say=say))
    others = other_arms(table, say=say)
    pictures.histogram(folder / "figure9.png", [r for r in table if r.measured.name in PUBLISHED])
    pictures.against_time(folder / "error_time.png", table)
    figures = write_figures(folder)
    parts = [
        *_table9(table),
        *_without(clean),
        *_bars(table),
        *_others(others),
        *_circle(circle),
        *_loaded(figures),
    ]
    body = "\n".join(parts)
    text = (
        f"<!doctype html><meta charset='utf-8'><title>The papers, regenerated</title><style>{STYLE}</style>\n{body}\n"
    )
    (folder / "index.html").write_text(text)


def _table(head, lines):
    out = "".join(f"<th>{escape(h)}</th>" for h in head)
    out += "".join("<tr>" + "".join(f"<td>{escape(str(c))}</td>" for c in line) + "</tr>" for line in lines)
    return f"<table><tr>{out}</tr></table>".replace("</th><tr>", "</th></tr><tr>").replace("</tr></tr>", "</tr>")


def _mm(values):
    return tuple(f"{v:.3f}" for v in values)


def _table9(table):
    before = nominal(table[0].measured, hidden(SIZE)).row
    lines = [("data sheet, registered", "", *_mm(before), "", "")]
    for r in table:
        if r.measured.name in PUBLISHED:
            published = PUBLISHED[r.measured.name]
            known = ("" if r.traced else " / ".join(f"{v:.3f}" for v in published),)
            off = "" if r.traced else " / ".join(f"{a - b:+.3f}" for a, b in zip(r.errors.row, published, strict=True))
            lines.append(
                (f"{r.measured.name}{', traced' * r.traced}", r.measured.poses, *_mm(r.errors.row), *known, off)
            )
    yield "<h1>The papers, regenerated from simulation</h1>"
    yield "<h2>TriCal paper, Table 9 and Figure 9</h2>"
    yield (
        "<p>One simulated KUKA KR 6 R700: its errors are those of Table 8, and it has what the paper's 31 parameters "
        "lack: five gears that run unevenly, play in joint 4, a link that bends. One size is common to these: that at "
        "which the tracker leaves the published mean on the average of five such arms; its maximum, its standard "
        "deviation and everything that TriCal leaves are predictions. All measure the poses that "
        "<code>edbb plan</code> chooses, and are judged at the same 500 random poses, free of collisions and with the "
        "reflector in sight, in a frame that 40 other poses placed.</p>"
    )
    head = ("instrument", "poses", "mean (mm)", "max", "std", "published mean / max / std", "difference")
    yield _table(head, lines)
    yield "<img src='figure9.png' alt='Histograms of the position errors'>"
    for r in table:
        if r.traced and r.measured.name in PUBLISHED:
            found = escape("; ".join(r.found) or "nothing")
            yield f"<p class='note'>Traced with {escape(r.measured.name)}: {found}.</p>"


def _without(clean):
    yield "<h3>Without the further effects</h3>"
    yield "<p>Then the model is complete, and every instrument brings the arm back to its noise.</p>"
    joint = [as_planted(r.calibration) for r in clean]
    lines = [
        (r.measured.name, r.measured.poses, *_mm(r.errors.row), f"{value:.1f} of {count}")
        for r, (value, count) in zip(clean, joint, strict=True)
    ]
    yield _table(("instrument", "poses", "mean (mm)", "max", "std", "joint χ² of the parameters"), lines)


def _bars(table):
    yield "<h2>How close the bar comes</h2>"
    lines = [
        (f"{r.measured.name}{', traced' * r.traced}", f"{r.measured.minutes:.1f}",
         f"{r.measured.euros:,.0f}".replace(",", " "), *_mm(r.errors.row), *_mm((r.expected_mm, r.held_out_mm)))
        for r in table
    ]  # fmt: skip
    head = ("instrument", "robot time (min)", "euros", "mean (mm)", "max", "std", "expected", "held out")
    yield _table(head, lines)
    yield (
        "<p class='note'>Expected: the tool's error over the workspace (mm rms): of a traced bar, by the posterior "
        "of the robot that is released, whose errors these are; else by the covariance of the fit, which knows of no "
        "effect that was not found. Held out: of the instrument's own readings (mm rms), a length for the bar.</p>"
    )
    yield "<img src='error_time.png' alt='Error against robot time'>"
    good = quickest(table)
    mean, largest, _ = PUBLISHED["laser tracker"]
    goal = f"mean {mean} and maximum {largest} mm of the published tracker calibration"
    if not good:
        yield f"<p>No plan of the bar reaches the {goal}.</p>"
        return
    best, row = good[0], good[0].errors.row
    yield (
        f"<p>The shortest robot time of a bar that reaches the {goal}: {escape(best.measured.name)}, "
        f"{best.measured.minutes:.1f} minutes, mean {row[0]:.3f} and maximum {row[1]:.3f} mm. "
        "Robot time is that of the planned path, timed with its rests, and two minutes to attach the bar at each "
        "place; prices are orders of magnitude.</p>"
    )
    yield f"<p class='note'>Traced there: {escape('; '.join(best.found))}.</p>"


def _others(others):
    if not others:
        return
    yield f"<h3>The same on {len(others[0].bar)} other arms</h3>"
    yield (
        "<p>Gears that err in other ways, other noise. Beside the bar, traced, stands the tracker whose model has no "
        "more than geometry and compliance. Sessions that do for the first arm are tried, the quickest first, until "
        "one does for all.</p>"
    )
    lines = [("laser tracker", "", *_each(others[0].tracker), "")]
    lines += [(o.name, f"{o.minutes:.1f}", *_each(o.bar), f"{o.hold.sum()} of {len(o.hold)}") for o in others]
    head = ("mean / max (mm)", "robot time (min)", *(f"arm {k}" for k in range(1, len(others[0].bar) + 1)), "no worse")
    yield _table(head, lines)
    last = others[-1]
    for_all = f"{escape(last.name)}, {last.minutes:.1f} minutes: does for all arms, the first included."
    yield f"<p>{for_all if last.hold.all() else 'No session that was tried does for all arms.'}</p>"


def _each(errors):
    return tuple(f"{mean:.3f} / {largest:.3f}" for mean, largest in errors)


def _circle(circle):
    yield "<h2>EDBB paper, section 4.1: circle against error-sensitive path</h2>"
    yield _table(("what", "published", "ours, median of 20 robots", "5 to 95 %"), circle)
    yield "<p class='note'>Each robot is drawn anew; the paper's robot and its fixture's true place are not known.</p>"


def _loaded(figures):
    yield "<h2>EDBB paper, section 4.2: the loaded bar</h2>"
    lines = [(r.what, r.unit, f"{r.published:.3g}", f"{r.ours:.3g}", f"{r.ours - r.published:+.2g}", r.remark)
             for r in loaded_rows()]  # fmt: skip
    yield _table(("what", "unit", "published", "ours", "difference", "what can be compared"), lines)
    for name in figures or ():
        yield f"<img src='{escape(Path(name).name)}' alt='{escape(Path(name).stem)}'>"
