"""A case of the golden record: files laid into an empty folder, then commands run there one after the other."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from planner.common.errors import PARTLY_DONE
from planner.common.summary import SCREEN_LINES
from tests.golden.documents import DRAWN, of_correction, of_files
from tests.golden.quantity import Quantity
from tests.golden.true_error import true_error_mm

ROOT = Path(__file__).resolve().parents[2]
QUIET = {
    "SOURCE_DATE_EPOCH": "1767225600",  # the date that corrected programs bear: 2026-01-01
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "POLARS_MAX_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "COLUMNS": "200",
    "NO_COLOR": "1",
    "MPLBACKEND": "agg",
}
KERNELS = {  # the same on every processor, unless the environment names others
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
}


@dataclass(frozen=True)
class Step:
    """One command: its words after ``python -m planner.cli``, its exit code, and facts that its messages state."""

    words: tuple[str, ...]
    code: int = 0
    facts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Case:
    """Files by name, each a text, bytes, or a function of the folder that writes it later; and the commands."""

    name: str
    files: dict[str, str | bytes | Callable[[Path], None]]
    steps: tuple[Step, ...]
    weight: int = 10  # seconds, roughly; the longest begin first


def edbb(line, code=0, facts=()):
    """A step from one line of words."""
    return Step(tuple(line.split()), code, tuple(facts))


def run(case):
    """Run a case in a folder of its own; return its quantities and the problems met on the way."""
    with tempfile.TemporaryDirectory(prefix="golden-") as name:
        folder = Path(name)
        laid = lay_files(case, folder)
        found, problems = [], []
        for k, step in enumerate(case.steps, start=1):
            done = subprocess.run(
                [sys.executable, "-m", "tests.golden.command", *step.words],
                capture_output=True,
                text=True,
                cwd=folder,
                env={**KERNELS, **os.environ, **QUIET, "PYTHONPATH": str(ROOT)},
                check=False,
            )
            problems += _problems(f"step {k} ({' '.join(step.words[:3])})", step, done)
            if done.returncode == step.code:
                found += [replace(q, case=case.name) for q in _of_step(step, folder)]
        found += of_files(case.name, folder, laid)
    return found, problems


def _problems(where, step, done):
    """Say what is wrong with the exit code, with what the message states, and with the length of a screen."""
    said = " ".join((done.stderr + " " + done.stdout).split())
    if done.returncode != step.code:
        return [f"{where}: exit code {done.returncode}, not {step.code}: {said[-600:]}"]
    missing = [fact for fact in step.facts if fact not in said]
    return [
        *(f"{where}: the message does not state '{fact}': {said[-600:]}" for fact in missing),
        *_long_screen(where, step, done),
    ]


def _of_step(step, folder):
    """Return the quantities of what a step corrected, and of a calibrated robot beside the simulated truth."""
    command, first, *_ = *step.words, ""
    out = folder / step.words[step.words.index("-o") + 1] if "-o" in step.words else None
    if command == "compensate" and step.code == 0:
        found = of_correction(folder / first, out)
        return [replace(q, name=f"{out.name}: {q.name}") for q in found]
    if command == "identify" and (folder / "truth.toml").exists() and (out / "robot.toml").exists():
        cell = folder / step.words[step.words.index("--cell") + 1]
        error = true_error_mm(cell, folder / "truth.toml", out / "robot.toml")
        return [Quantity("", f"{out.name}: true error of the robot that is written, rms", error, "mm", DRAWN, "less")]
    return []


def _long_screen(where, step, done):
    """What is wrong with the length of a screen; lists have as many lines as there are things."""
    lines = (done.stderr if "--json" in step.words else done.stderr + done.stdout).splitlines()
    if done.returncode not in (0, PARTLY_DONE) or step.words[0] in ("robots", "dialects") or len(lines) <= SCREEN_LINES:
        return []
    return [f"{where}: the screen has {len(lines)} lines: {lines}"]


def lay_files(case, folder):
    """Write the files of a case into a folder; return their names."""
    for name, content in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return set(case.files)
