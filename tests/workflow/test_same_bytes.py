"""Same input, same seed, same bytes: in another process, on any number of threads, whatever order a set has."""

import shutil
import subprocess
import sys

import pytest

from tests.golden.case import ROOT, lay_files
from tests.golden.cases import CASES
from tests.processors import with_threads


@pytest.mark.slow
def test_a_calibration_is_the_same_on_one_thread_and_on_two(tmp_path):
    (case,) = (c for c in CASES if c.name == "irb120-ball-socket")
    (step,) = case.steps
    written = []
    for threads in ("1", "2"):
        lay_files(case, tmp_path)
        how = with_threads(threads)
        how["env"] |= {"PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "tests.golden.command", *step.words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, **how)
        assert done.returncode == 0, done.stderr
        files = (p for p in (tmp_path / "found").rglob("*") if p.is_file())
        written.append({str(p.relative_to(tmp_path)): p.read_bytes() for p in files})
        shutil.rmtree(tmp_path / "found")
    assert len(written[0]) > 3
    assert written[0] == written[1]
