"""Programs of PDL2, URScript and G-code as integrators write them: no target is silently wrong.

Beside each program stands what is true of every motion (``NAME.toml``), written from the language's manual: the joint
angles that it drives to and the line that holds their numbers, a place (``pose``), or that nobody can know it from the
text. A correction is judged by an own reader and own kinematics (``joint_programs``), not by what the command says of
itself. ``traps.toml`` holds single statements that must never pass for a plain target.
"""

import collections
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.command import edbb
from tests.compensation.joint_programs import (
    TRUE_ROWS,
    apart,
    controller_of,
    flange,
    identity_rows,
    joint_targets,
    write_calibrated,
)

PROGRAMS = Path(__file__).parent / "programs"
ROBOTS = Path(__file__).parents[2] / "robots"
FAR_MM, FAR_DEG = 0.05, 0.01  # a six-axis arm that is corrected rightly stands closer

# Motions by what became of them, as it is today: fewer corrected ones are a step back
LEAST_CORRECTED = {"pdl2": 73, "urscript": 48, "gcode": 37}


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrated")
    for name, rows in TRUE_ROWS.items():
        write_calibrated(ROBOTS / name / "robot.toml", folder / name, rows)
    return folder


def programs(language):
    return sorted(p for p in (PROGRAMS / language).rglob("*") if p.is_file() and p.suffix != ".toml")


def numbers(ranges):
    """Lines that a report names: 3, 5-7."""
    found = set()
    for first, last in re.findall(r"(\d+)(?:-(\d+))?", ranges):
        found |= set(range(int(first), int(last or first) + 1))
    return found


def compensated(path, robot, out, options=()):
    """Exit code, lines of the result without the mark, lines listed as left, lines said to be corrected (or None)."""
    done = edbb("compensate", path, "--model", robot / "robot.toml", "-o", out, "-v", *options)
    if done.returncode not in (0, 5):
        return done.returncode, None, set(), None
    source, result = (p.read_text(encoding="utf-8").splitlines() for p in (path, out))
    more = len(result) - len(source)
    start = next(i for i, line in enumerate(result) if "edbb-compensated" in line)
    left = re.search(r"lines left as they were: (.*)", done.stdout + done.screen)
    said = re.search(r"corrected lines: (.*)", done.stdout + done.screen)
    body = result[:start] + result[start + more :]
    assert len(body) == len(source)
    return done.returncode, body, numbers(left[1]) if left else set(), numbers(said[1]) if said else None


def judge(path, robots, folder, spoil=None):
    """Outcome of every motion of a program: corrected, listed, refused, or silently wrong with the reason."""
    truth = tomllib.loads(path.with_name(path.name + ".toml").read_text(encoding="utf-8"))
    robot, motions = truth["robot"], truth["motion"]
    code, body, listed, said = compensated(path, robots / robot, folder / path.name, truth.get("options", ()))
    if code == 2:
        return [(m["kind"], "refused", "") for m in motions]
    assert body is not None, f"{path.name} ends with exit code {code}"
    body = spoil(body) if spoil else body
    source = path.read_text(encoding="utf-8").splitlines()
    changed = {i for i, (a, b) in enumerate(zip(source, body, strict=True), 1) if a != b}
    nominal, true = (tomllib.loads((f / robot / "robot.toml").read_text(encoding="utf-8")) for f in (ROBOTS, robots))
    written, controller = joint_targets(path, body), controller_of(path)
    outcomes, holding = [], set()
    for m in motions:
        line = m.get("numbers_in_line", m["line"])
        is_listed = bool(listed & {line, m["line"]})
        if m["kind"] != "fixed":
            wrong = "changed" if m["line"] in changed else "" if is_listed else "not listed"
            outcomes.append((m["kind"], "silent" if wrong else "listed", f"line {m['line']}: {m['kind']}, {wrong}"))
            continue
        holding.add(line)
        targets = written.get(line, [])[m.get("which", 0) :]
        mm, deg = float("inf"), float("inf")
        if targets:
            mm, deg = apart(flange(nominal, m["joints_deg"], controller), flange(true, targets[0], controller))
        right = mm < FAR_MM and deg < FAR_DEG
        outcome = "corrected" if right else "listed" if is_listed and line not in changed else "silent"
        outcomes.append(("fixed", outcome, f"line {m['line']}: {mm:.3f} mm, {deg:.4f} deg"))
    outcomes += [("other", "silent", f"line {i} holds no target and was changed") for i in sorted(changed - holding)]
    if said is not None and spoil is None and not said >= changed:
        outcomes.append(("report", "silent", f"corrected lines are {sorted(changed)}, the report says {sorted(said)}"))
    return outcomes


@pytest.mark.slow
@pytest.mark.parametrize("language", ["pdl2", "urscript", "gcode"])
def test_no_motion_of_foreign_programs_is_silently_wrong(language, calibrated, tmp_path):
    found = {p.relative_to(PROGRAMS).as_posix(): judge(p, calibrated, tmp_path) for p in programs(language)}
    silent = [f"{name}: {why}" for name, rows in found.items() for _, outcome, why in rows if outcome == "silent"]
    assert not silent, "\n".join(silent)
    count = collections.Counter(outcome for rows in found.values() for _, outcome, _ in rows)
    assert len(found) >= 25
    assert count["corrected"] >= LEAST_CORRECTED[language], count


@pytest.mark.parametrize("language", ["pdl2", "urscript", "gcode"])
def test_the_truths_of_foreign_programs_are_what_their_texts_say(language):
    """The own reader finds the angles that the truth names wherever they stand as plain numbers in a line."""
    for path in programs(language):
        targets = joint_targets(path, path.read_text(encoding="utf-8").splitlines())
        for m in tomllib.loads(path.with_name(path.name + ".toml").read_text(encoding="utf-8"))["motion"]:
            if m["kind"] == "fixed":
                there = targets[m.get("numbers_in_line", m["line"])][m.get("which", 0)]
                assert there == pytest.approx(m["joints_deg"], abs=1e-6), f"{path.name}:{m['line']}"


@pytest.mark.slow
def test_a_calibration_that_found_nothing_moves_no_target_of_foreign_programs(tmp_path):
    robots, out = tmp_path / "robots", tmp_path / "out"
    out.mkdir()
    for name, rows in TRUE_ROWS.items():
        nominal = ROBOTS / name / "robot.toml"
        write_calibrated(nominal, robots / name, identity_rows(nominal, rows))
    for path in [*programs("pdl2")[:8], *programs("urscript")[:4], *programs("gcode")[:3]]:
        robot = tomllib.loads(path.with_name(path.name + ".toml").read_text(encoding="utf-8"))["robot"]
        code, body, _, _ = compensated(path, robots / robot, out / path.name)
        assert code == 0
        targets = joint_targets(path, path.read_text(encoding="utf-8").splitlines())
        assert targets
        written = joint_targets(path, body)
        assert written.keys() == targets.keys()
        assert all(np.allclose(written[line], targets[line], rtol=0, atol=1e-9) for line in targets)


def test_the_judge_sees_a_wrong_correction_and_a_touched_line(calibrated, tmp_path):
    path = PROGRAMS / "pdl2" / "p01_machine_tending.pdl"

    def one_digit(body):
        line = next(i for i, text in enumerate(body) if text.lstrip().startswith("MOVE TO {"))
        return [*body[:line], re.sub(r"\{(-?\d+)\.", lambda m: f"{{{int(m[1]) + 1}.", body[line]), *body[line + 1 :]]

    assert [o for _, o, _ in judge(path, calibrated, tmp_path, one_digit)].count("silent") == 1
    touched = judge(path, calibrated, tmp_path, lambda body: [*body[:-1], body[-1] + " "])
    assert [kind for kind, o, _ in touched if o == "silent"] == ["other"]
    untouched = judge(path, calibrated, tmp_path, lambda _: path.read_text(encoding="utf-8").splitlines())
    assert {o for _, o, _ in untouched} == {"silent"}


def traps():
    found = []
    for file in sorted(PROGRAMS.glob("*/traps.toml")):
        for group in tomllib.loads(file.read_text(encoding="utf-8"))["program"]:
            for text in group["traps"]:
                found.append(pytest.param(group, text, id=f"{group['file']}: {text.strip()[:60]}"))
    return found


@pytest.mark.parametrize(("group", "text"), traps())
def test_a_trap_is_refused_or_listed(group, text, calibrated, tmp_path):
    """One trap in a program that is good without it; a trap that changes later moves leaves those uncorrected too."""
    before, after = group["text"].split("@@\n")
    path = tmp_path / group["file"]
    path.write_text(before + text + "\n" + after, encoding="utf-8")
    source = path.read_text(encoding="utf-8").splitlines()
    code, body, listed, _ = compensated(path, calibrated / group["robot"], tmp_path / "out", group.get("options", ()))
    if code == 2:
        return
    assert code == 5, "corrected whole"
    first = before.count("\n") + 1
    own = set(range(first, first + text.count("\n") + 1))
    changed = {i for i, (a, b) in enumerate(zip(source, body, strict=True), 1) if a != b}
    assert not own & changed
    assert own & listed
    if group.get("behind"):
        assert not {i for i in changed if i > max(own)}
