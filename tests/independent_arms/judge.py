"""One arm from its run to the verdict: what the product states of it, and what is true.

The true error of a robot model is that of the tool where the model was used to correct the way there: joint targets
anywhere in the workspace are corrected by `edbb compensate`, the true arm drives to the corrected angles, and its tool
is compared with where the nominal robot, with the tool point of the model, says that it is. A rigid motion of all
points is taken away (no run tells how the base stands; the documentation of the stated error aligns the base as well),
a scale is not. Causes that depend on time or temperature stand where they stood in the middle of the run.
"""

import json
import tomllib
from dataclasses import dataclass

import numpy as np

from tests.command import edbb
from tests.independent_arms import runs
from tests.independent_arms.arm import TOOL, make_arm, workspace
from tests.independent_arms.chain import frames, points
from tests.independent_arms.fit import fit_geometry, rigid

STATES = 400
INSIDE = np.radians(3.0)  # targets keep off the strokes' ends, so that their correction is within them


def rms_aligned(here, there):
    """Root mean square distance of points after the best rigid motion, in mm."""
    turn, shift = rigid(there, here)
    return 1e3 * float(np.sqrt(np.mean(np.sum((there @ turn.T + shift - here) ** 2, 1))))


def evaluation_states(arm, seed):
    q = workspace(arm, 2 * STATES, np.random.default_rng([seed, 99]))
    inside = np.all((q > arm.low + INSIDE) & (q < arm.high - INSIDE), 1)
    return q[inside & (np.abs(np.sin(q[:, 4])) > 0.05)][:STATES]


def correct(q, model, folder):
    """Joint targets as `edbb compensate` corrects them, and which of them it has corrected."""
    targets, corrected = folder / "targets.csv", folder / "corrected.csv"
    rows = [",".join(runs.JOINTS)] + [",".join(f"{v:.9f}" for v in row) for row in np.degrees(q).tolist()]
    targets.write_text("\n".join(rows) + "\n", encoding="utf-8")
    done = edbb("compensate", targets, "--model", model, "-o", corrected, "--force")
    if done.returncode not in (0, 5):
        raise RuntimeError(f"edbb compensate: exit {done.returncode}: {done.stderr}")
    lines = [row for row in corrected.read_text(encoding="utf-8").splitlines() if row and not row.startswith("#")]
    names = lines[0].split(",")
    columns = [names.index(name) for name in runs.JOINTS]
    table = np.radians([[float(row.split(",")[k]) for k in columns] for row in lines[1:]])
    return table, np.any(np.abs(table - q) > 1e-9, axis=1)


def model_error(true, q, model, folder, condition):
    """True rms error [mm] of the tool that is driven by a released robot, and the share of targets that it corrects."""
    corrected, done = correct(q, model, folder)
    tool = np.array(tomllib.loads(model.read_text(encoding="utf-8"))["tool_points"][0]["position_mm"]) / 1e3
    meant = points(frames(true.arm, q[done])[6], tool)
    return rms_aligned(true.points(corrected[done], **condition), meant), float(np.mean(done))


@dataclass(frozen=True)
class Names:
    """Findings of a report against what is hidden."""

    true: int  # hidden causes that a report can name
    right: int  # found or likely
    rival: int  # hidden causes named only as the rival of a finding
    wrong: int  # findings that are asserted, and that are no hidden cause, nor is one of their rivals
    found: int
    doubtful: int = 0  # findings than which the report calls another cause, or none, likelier
    asserted: int = 0  # findings that the report calls found, not likely or doubtful
    listed_wrong: int = 0  # findings, doubtful or not, that are no hidden cause, nor is one of their named rivals


def _is(named, cause):
    effect, on = named
    kind = any(effect.startswith(name) for name in cause.names)
    digits = {int(c) for c in on if c.isdigit()}
    return kind and (not cause.numbers or not digits or bool(digits & set(cause.numbers)))


def _rivals(finding):
    """Rivals as (effect, place), whether a report gives them as texts or as tables."""
    for rival in finding.get("rivals", []):
        if isinstance(rival, dict):
            yield str(rival.get("effect", "")), str(rival.get("on", ""))
        else:
            effect, _, on = str(rival).partition(", ")
            yield effect, on


def each_finding(findings):
    """Findings one by one: many of one kind stand in the list as one, with its members."""
    return [member for f in findings for member in f.get("members") or [f]]


def _is_below(finding, probability):
    return finding.get("probability") is not None and finding["probability"] < probability


def judge_names(findings, causes):
    """Hold findings against what is hidden, in two ways, since it is a matter of what a person takes from a report.

    ``wrong`` counts what the report calls found: not what it calls likely or doubtful (docs/how-to/rivals.md), and
    neither what it says may as well be a cause without a name, where a hidden cause is one. ``listed_wrong``
    counts all that stands in the list: a person may act on a doubtful line, and "or something without a name" fits
    whatever is hidden, wherever it acts. The first is the figure of the product's own promise (2 % at most); the
    second is the one to compare with lists that have no probabilities.
    """
    known, foreign = [c for c in causes if c.names], any(not c.names for c in causes)
    findings = [f for f in findings if f["effect"] != "unnamed"]  # described by what moves with what, called nothing
    sure, asserted = ([f for f in findings if not _is_below(f, p)] for p in (0.5, 0.9))
    right = {id(c) for c in known for f in sure if _is((f["effect"], str(f["on"])), c)}
    named = [(f["effect"], str(f["on"])) for f in findings if _is_below(f, 0.5)]
    named += [r for f in findings for r in _rivals(f)]
    rival = {id(c) for c in known for name in named if _is(name, c)} - right

    def stands(f):
        return any(_is(name, c) for name in [(f["effect"], str(f["on"])), *_rivals(f)] for c in known)

    def is_left_open(f):
        return foreign and any(effect == "unnamed" for effect, _ in _rivals(f))

    wrong = [f for f in asserted if not stands(f) and not is_left_open(f)]
    listed = [f for f in findings if not stands(f)]
    doubtful = len(findings) - len(sure)
    return Names(len(known), len(right), len(rival), len(wrong), len(findings), doubtful, len(asserted), len(listed))


def identify(columns, session, folder, *options, name="calibrated"):
    """Run `edbb identify`; the folder of its result, or None where it refuses to write a robot."""
    runs.write_run(columns, folder / "run.csv")
    out = folder / name
    done = edbb("identify", folder / "run.csv", *session.words(), "-o", out, "--force", *options)
    if done.returncode == 3:
        return None
    if done.returncode:
        raise RuntimeError(f"edbb identify: exit {done.returncode}: {done.stderr}")
    return out


def judge(seed, session, count, with_foreign, folder, product_geometry=False):
    """One row of the table; ``product_geometry`` judges what `edbb identify --geometry` releases as well."""
    true = make_arm(seed, session.gauge, count, with_foreign)
    columns = session.measure(true)
    row = {
        "seed": seed, "gauge": session.gauge, "causes": count, "foreign": int(with_foreign),
        "hidden": "; ".join(f"{c.kind}, {c.where} ({c.size})" for c in true.causes),
    }  # fmt: skip
    condition = runs.middle(columns["t_s"])
    q = evaluation_states(true.arm, seed)
    place = true.points(q, **condition)
    row["nominal_mm"] = rms_aligned(place, points(frames(true.arm, q)[6], TOOL))
    row["geometry_mm"] = rms_aligned(place, fit_geometry(true.arm, columns).points(true.arm, q))
    calibrated = identify(columns, session, folder)
    if calibrated is None:
        return row | {"refused": 1}
    released, corrected = model_error(true, q, calibrated / "robot.toml", folder, condition)
    if product_geometry:
        alone = identify(columns, session, folder, "--geometry", "--no-trace", name="alone")
        row["product_geometry_mm"] = model_error(true, q, alone / "robot.toml", folder, condition)[0]
    report = json.loads((calibrated / "identification.json").read_text(encoding="utf-8"))
    there = np.radians(np.stack([columns[name] for name in runs.JOINTS], axis=1))
    near, _ = model_error(true, there[:: max(1, len(there) // STATES)], calibrated / "robot.toml", folder, condition)
    findings = each_finding(report["findings"])
    names = judge_names(findings, true.causes)
    return row | {
        "refused": 0, "released_mm": released, "stated_mm": report["known_anywhere_mm"],
        "bound_mm": report["release"]["at_most_mm"], "near_mm": near,
        "stated_near_mm": report["release"]["where_measured_mm"],
        "stated_geometry_mm": report["release"]["geometry_anywhere_mm"],
        "stated_nominal_mm": report["release"]["nominal_anywhere_mm"], "corrected": corrected, "true": names.true,
        "right": names.right, "rival": names.rival, "wrong": names.wrong, "found": names.found,
        "doubtful": names.doubtful, "asserted": names.asserted, "listed_wrong": names.listed_wrong,
        "findings": "; ".join(f"{f['effect']}, {f['on']}" for f in findings),
    }  # fmt: skip
