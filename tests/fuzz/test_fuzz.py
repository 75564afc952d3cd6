"""No file ends in a traceback, a hang or all of the memory: spoiled files for every way in."""

import time
import warnings

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from planner.common.errors import PlannerError
from tests.fuzz.seeds import SURFACES
from tests.fuzz.spoiling import spoiled
from tests.not_everywhere import resource

LONGEST_S, MOST_BYTES = 10.0, 2 * 1024**3
QUICK, LONG = 20, 340  # cases for each way in: about 300 and more than 5 000
MOST_MESSAGE = 2700


@pytest.fixture(autouse=True)
def _little_memory():
    """Let a reader that asks for more than 2 GB fail."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm", encoding="ascii") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + MOST_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def _read(name: str, folder, data: bytes) -> None:
    """Read a file; what is wrong with it is said in one sentence of a sensible length, without control signs."""
    surface = SURFACES[name]
    path = folder / surface.file
    path.write_bytes(data)
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            surface.read(path)
    except PlannerError as err:
        text = str(err)
        assert len(text) < MOST_MESSAGE, text[:300]
        assert not [c for c in text if ord(c) < 32 and c != "\n"], repr(text[:300])
    assert time.process_time() - start < LONGEST_S


def _fuzz(name: str, folder, cases: int) -> None:
    seed = SURFACES[name].seed(folder)
    _read(name, folder, seed)

    @settings(
        max_examples=cases, deadline=None, derandomize=True, database=None, phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(data=spoiled(seed) | st.binary(max_size=200))
    def run(data: bytes) -> None:
        _read(name, folder, data)

    run()


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_a_spoiled_file_is_told(name, tmp_path):
    _fuzz(name, tmp_path, QUICK)


@pytest.mark.long
@pytest.mark.parametrize("name", SURFACES)
def test_thousands_of_spoiled_files_are_told(name, tmp_path):
    _fuzz(name, tmp_path, LONG)
