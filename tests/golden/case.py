"""A case of the golden record: files laid into an empty folder, then commands run there one after the other."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from planner.common.errors import PARTLY_DONE
from planner.common.summary import SCREEN_LINES
from tests.golden.condense import condense, short

ROOT = Path(__file__).resolve().parents[2]
QUIET = {
    "SOURCE_DATE_EPOCH": "1767225600",  # the date that corrected programs bear: 2026-01-01
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",  # the same kernels on every processor
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "POLARS_MAX_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "COLUMNS": "200",
    "NO_COLOR": "1",
    "MPLBACKEND": "agg",
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
    own: frozenset[str] = field(default_factory=frozenset)


def edbb(line, code=0, facts=()):
    """A step from one line of words."""
    return Step(tuple(line.split()), code, tuple(facts))


def run(case):
    """Run a case in a folder of its own and return its condensed outputs and the problems met on the way."""
    with tempfile.TemporaryDirectory(prefix="golden-") as name:
        folder = Path(name)
        laid = lay_files(case, folder)
        steps, problems = [], []
        for k, step in enumerate(case.steps, start=1):
            done = subprocess.run(
                [sys.executable, "-m", "planner.cli", *step.words],
                capture_output=True,
                text=True,
                cwd=folder,
                env={**os.environ, **QUIET, "PYTHONPATH": str(ROOT)},
                check=False,
            )
            where = f"step {k} ({' '.join(step.words[:3])})"
            if done.returncode != step.code:
                problems.append(f"{where}: exit code {done.returncode}, not {step.code}: {done.stderr[-600:]}")
            said = " ".join((done.stderr + " " + done.stdout).split())
            problems += [
                f"{where}: the message does not state '{fact}': {said[-600:]}"
                for fact in step.facts
                if fact not in said
            ]
            problems += _long_screen(where, step, done)
            steps.append({"command": " ".join(step.words), "code": done.returncode, **_printed(step, done.stdout)})
        files = {
            str(p.relative_to(folder)): condense(p)
            for p in sorted(folder.rglob("*"))
            if p.is_file() and str(p.relative_to(folder)) not in laid
        }
    return {"steps": steps, "files": files}, problems


def _long_screen(where, step, done):
    """What is wrong with the length of a screen; lists have as many lines as there are things."""
    lines = (done.stderr if "--json" in step.words else done.stderr + done.stdout).splitlines()
    if done.returncode not in (0, PARTLY_DONE) or step.words[0] in ("robots", "dialects") or len(lines) <= SCREEN_LINES:
        return []
    return [f"{where}: the screen has {len(lines)} lines: {lines}"]


def _printed(step, out):
    if "--json" in step.words and out.strip():
        return {"json": short(json.loads(out))}
    return {}


def lay_files(case, folder):
    """Write the files of a case into a folder; return their names."""
    for name, content in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return set(case.files)
