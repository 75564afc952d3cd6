"""The worker in the background runs no code of the folder that one is in, and ends with its parent."""

import os
import signal
import subprocess
import sys
import time

import numpy as np

from planner.design.selection.index_curves import BackgroundCurve, compute_index_curve

SLOW = """
import sys, time, numpy as np
from planner.design.selection.index_curves import BackgroundCurve
rows = np.random.default_rng(0).normal(size=(3000, 1, 25))
curve = BackgroundCurve(rows, range(26, 300), "O2", 0)
print(curve._process.pid, flush=True)
time.sleep(60)
"""


def test_no_module_is_taken_from_the_current_folder(tmp_path, monkeypatch):
    for name in ("pickle", "numpy", "planner"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close(); raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    rows = np.random.default_rng(0).normal(size=(60, 1, 4))
    with BackgroundCurve(rows, [5, 6, 7], "O2", 0) as curve:
        found = curve.result()
    assert not (tmp_path / "ran").exists()
    again = compute_index_curve(rows, [5, 6, 7], "O2", 0)
    np.testing.assert_array_equal(found.values, again.values)


def test_the_worker_ends_with_its_parent():
    parent = subprocess.Popen([sys.executable, "-c", SLOW], stdout=subprocess.PIPE, text=True)
    worker = int(parent.stdout.readline())
    time.sleep(1.0)
    os.kill(worker, 0)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.2)
    raise AssertionError("the worker lives on")
