"""Files whose fixtures are shared go to one worker, and the longest first: none is left alone with one at the end."""

import gc
import os
import sys
import time
from functools import partialmethod
from pathlib import Path

import pytest

from tests.browser import Browser, require_browser
from tests.processors import keep_to_one

keep_to_one(os.environ.get("PYTEST_XDIST_WORKER", ""))  # before numpy is imported
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # hundreds of processes are started: compiled once, not in each
sys.dont_write_bytecode = False
if sys.platform == "win32":  # tests write the same bytes as elsewhere; CR LF and cp1252 have tests of their own
    Path.write_text = partialmethod(Path.write_text, encoding="utf-8", newline="\n")
    Path.read_text = partialmethod(Path.read_text, encoding="utf-8")
gc.set_threshold(20_000, 20, 50)  # all that is imported here is not looked through for garbage again and again

TOGETHER = (
    "tests/report", "tests/circular", "tests/gauges/trical", "tests/studies", "tests/accuracy",
    "tests/loaded", "tests/windows",
)  # fmt: skip
OF_SOURCES = (  # parse every file of the planner: once, in one process
    "tests/test_layers.py", "tests/test_planning_packages.py", "tests/wings/test_left_out.py",
    "tests/cli/test_recommended.py", "tests/docs/test_plain_words.py", "tests/test_long_runs.py",
)  # fmt: skip
SHARED = {  # what computes the same as another file
    "tests/workflow/test_screens.py": "tests/checks/test_refused_robots.py",
    "tests/identification/test_suitability.py": "tests/identification/test_posterior.py",
    **dict.fromkeys(OF_SOURCES, "tests/test_layers.py"),
}
LONGEST = (  # by default, and of those that are run on demand
    "tests/programs/linuxcnc/test_motion_controller.py",
    "tests/workflow/test_plan.py", "tests/reproduction/test_table9.py", "tests/test_examples.py",
    "tests/fuzz/test_fuzz.py", "tests/service/test_remote.py", "tests/blind/test_blind.py",
    "tests/workflow/test_places.py", "tests/test_readme.py", *TOGETHER, "tests/motion/path/test_join.py",
    "tests/cli/test_kills.py", "tests/design/discrimination/test_loop.py", "tests/identification/test_coverage.py",
    "tests/identification/test_anywhere.py", "tests/service/test_openapi.py", "tests/tracing/test_change_points.py",
    "tests/tracing/test_findings.py", "tests/tracing/test_curve.py", "tests/design/selection/test_searches.py",
    "tests/design/selection/test_bounds.py", "tests/identification/test_noise.py", "tests/tracing/test_screen.py",
    "tests/service/test_crashes.py", "tests/effects/catalogue/test_kinds.py", "tests/programs/test_round_trip.py",
    "tests/workflow/test_identify.py",
)  # fmt: skip


@pytest.fixture(scope="session")
def browser():
    """A browser in which pages are opened; skips where there is none."""
    require_browser()
    opened = Browser()
    yield opened
    opened.stop()


def scope_of(nodeid):
    """The folder of a test whose fixtures are shared there, else its file, or the one that computes the same."""
    file = nodeid.split("::")[0]
    folder = file.rpartition("/")[0]
    return folder if folder in TOGETHER else SHARED.get(file, file)


def pytest_collection_modifyitems(items):
    """The longest first."""
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(scope_of(item.nodeid), len(place)))


def pytest_collection_finish():
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    from xdist.scheduler import LoadFileScheduling

    class FolderScheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return scope_of(nodeid)

    return FolderScheduling(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Skip long tests that would begin after ``EDBB_LONG_UNTIL_S`` (seconds since 1970), and ``posix`` on Windows."""
    until = float(os.environ.get("EDBB_LONG_UNTIL_S", "inf"))
    if item.get_closest_marker("long") and time.time() > until:
        pytest.skip("no time was left for this long test")
    if sys.platform == "win32" and item.get_closest_marker("posix"):
        pytest.skip("this system has no links without rights, named pipes, fork or devices as files")
