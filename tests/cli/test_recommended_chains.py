"""What the screen recommends is done to its end: from a cell to the last command that is named, without a person.

``EDBB_ALL_TRIALS=1 python -m pytest -m long -n 16 --dist worksteal tests/cli/test_recommended_chains.py`` drives the
chains of all shipped cells with two seeds (``-k kuka`` takes a part); ``python -m tests.cli.recommended_chains`` prints
a line for each.
"""

import os

import pytest

from planner.cell.reading import shipped_cells
from tests.cli.recommended_chains import commands_in, drive_chain

ALL = pytest.mark.skipif(not os.environ.get("EDBB_ALL_TRIALS"), reason="takes an hour: only with EDBB_ALL_TRIALS=1")


def test_commands_are_found_in_what_is_printed():
    text = """
  next        run the program and log it (to try it: edbb simulate mine/plan.json -o run.csv)
              edbb identify run.csv --cell mine/cell.toml --plan mine/plan.json -o calibrated
  next        edbb compensate PROGRAM --model cal/robot.toml -o CORRECTED corrects a program
              edbb plan CELL --separate cal -o apart seeks poses that tell the causes apart, says how surely
  next        edbb centre mine/plan.json measures it
              edbb identify run.csv --plan mine/plan.json -o again
  next        look at x/report.html; edbb plan CELL --fixtures 2 -o plan plans with the place that adds most
"""
    assert [" ".join(words) for words in commands_in(text)] == [
        "simulate mine/plan.json -o run.csv",
        "identify run.csv --cell mine/cell.toml --plan mine/plan.json -o calibrated",
        "compensate PROGRAM --model cal/robot.toml -o CORRECTED",
        "plan CELL --separate cal -o apart",
        "identify run.csv --plan mine/plan.json -o again",
        "plan CELL --fixtures 2 -o plan",
    ]


@ALL
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", shipped_cells())
def test_what_is_recommended_works_to_its_end(name, seed, tmp_path):
    chain = drive_chain(name, seed, tmp_path)
    print(f"{name} seed {seed}: {len(chain.done)} commands", *chain.done, sep="\n    ")
    assert {"plan", "simulate"} <= {words.split()[0] for words in chain.done}
    assert len(chain.done) >= 3
