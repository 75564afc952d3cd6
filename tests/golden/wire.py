"""A small run of a wire, fitted and not traced: once in a process, for all who show or use what comes of it."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from planner.workflow.identification import identify
from tests.golden.case import lay_files
from tests.golden.cases import CASES
from tests.identification.few_draws import few_draws

PLACE = TemporaryDirectory(prefix="wire")  # goes with the process


@cache
def fitted_wire():
    """The result of ``edbb identify``."""
    folder = Path(PLACE.name)
    (case,) = (c for c in CASES if c.name == "irb120-draw-wire")
    lay_files(case, folder)
    with few_draws():
        return identify(folder / "wire.csv", cell=folder / "cell.toml", no_trace=True)
