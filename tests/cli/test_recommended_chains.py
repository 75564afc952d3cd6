"""What the screen recommends is done to its end: from a cell to the last command that is named, without a person.

``EDBB_ALL_TRIALS=1`` drives the chains of all shipped cells with two seeds (``-k kuka`` takes a part). What a person
would fill in (``CELL``, ``PROGRAM``, ``RECORD`` …) is filled in as the pages say.
"""

import os
import re
from dataclasses import dataclass, field

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.cli.app import verbs
from planner.common.errors import PARTLY_DONE
from tests.command import edbb

ALL = pytest.mark.skipif(not os.environ.get("EDBB_ALL_TRIALS"), reason="takes hours: only with EDBB_ALL_TRIALS=1")
NAMED = re.compile(r"\bedbb (?P<verb>[a-z]+(?:-[a-z]+)*) (?P<rest>[^();]*?-o \S+?)(?=[);,]?(?:\s|$))")
BY_HAND = {"measure", "centre", "export", "serve", "import"}  # need a gauge, a robot or a person's files
POSES = 40  # of a first session: enough to fit, few enough to plan in a minute
WITHOUT_CIRCLES = {"comau-nj130/circular": "comau-nj130/edbb"}  # where poses show the causes of what circles show
LOADED = "abb-irb6700/ldbb"
OF_CIRCLES = {"comau-nj130/circular", LOADED}  # have no poses to be chosen
MOST = 14  # commands of one chain
ENDS = {0, PARTLY_DONE}  # the second: lines of a program that were left are named


@dataclass
class Chain:
    """The commands that were named and those that were done, in a folder of their own."""

    folder: object
    cell: str
    seed: int
    done: list = field(default_factory=list)
    named: list = field(default_factory=list)

    def do(self, words):
        """Do a command as it is typed, and note what its screen names."""
        told = edbb(*words, cwd=self.folder)
        self.done.append(" ".join(words))
        assert told.returncode in ENDS, f"{' && '.join(self.done)}\n{told.stderr}"
        self.named += [words for words in commands_in(told.stderr) if words not in self.named]

    def fill(self, words):
        """Return the words of a named command with what a person fills in."""
        plan = WITHOUT_CIRCLES.get(self.cell, "plan/cell.toml")
        known = {"CELL": plan, "PROGRAM": "targets.csv", "CORRECTED": "corrected.csv", "RECORD": "record"}
        known |= {"CALIBRATED": "calibrated", "DIR": "more"}
        filled = [known.get(word, word) for word in words]
        if filled[0] == "plan" and "--poses" not in filled and "--separate" not in filled:
            filled += ["--poses", str(POSES)]
        if filled[0] == "record" and not (self.folder / "record").exists():
            filled += ["--serial", "0815"]
        if filled[0] == "simulate":
            filled += ["--seed", str(self.seed)]
        return filled

    def follow(self):
        """Do what is named, each command once, in the order in which it was named."""
        for words in self.named:
            under_load = self.cell == LOADED  # of circles both evaluations are named, "under load" before the second
            other = words[0] == ("circular" if under_load else "loaded")
            if other or words[0] in BY_HAND or len(self.done) >= MOST:
                continue
            self.do(self.fill(words))


def commands_in(text):
    """The commands that a screen names, as words: each up to its output, as it would be copied."""
    found = ((m["verb"], *m["rest"].split()) for m in NAMED.finditer(text))
    return [words for words in dict.fromkeys(found) if words[0] in verbs()]


def chain_of(name, seed, folder):
    """Plan a session of a shipped cell, and follow what the screens name from there."""
    chain = Chain(folder, name, seed)
    cell = load_cell(name)
    home = np.rad2deg(cell.home)
    titles = ",".join(f"q{i}_deg" for i in range(1, len(home) + 1))
    rows = "\n".join(",".join(f"{v + step:.4f}" for v in home) for step in (0.0, 2.0, -2.0))
    (folder / "targets.csv").write_text(f"{titles}\n{rows}\n")
    poses = () if name in OF_CIRCLES else ("--poses", str(POSES))
    chain.do(["plan", name, "-o", "plan", "--seed", str(seed), *poses])
    chain.follow()
    return chain


def test_commands_are_found_in_what_is_printed():
    text = """
  next        run the program and log it (to try it: edbb simulate mine/plan.json -o run.csv)
              edbb identify run.csv --cell mine/cell.toml --plan mine/plan.json -o calibrated
  next        edbb compensate PROGRAM --model cal/robot.toml -o CORRECTED corrects a program
              edbb plan CELL --separate cal -o apart tells the causes apart
  next        look at x/report.html; edbb plan CELL --fixtures 2 -o plan plans with the place that adds most
"""
    assert [" ".join(words) for words in commands_in(text)] == [
        "simulate mine/plan.json -o run.csv",
        "identify run.csv --cell mine/cell.toml --plan mine/plan.json -o calibrated",
        "compensate PROGRAM --model cal/robot.toml -o CORRECTED",
        "plan CELL --separate cal -o apart",
        "plan CELL --fixtures 2 -o plan",
    ]


@ALL
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", shipped_cells())
def test_what_is_recommended_works_to_its_end(name, seed, tmp_path):
    chain = chain_of(name, seed, tmp_path)
    verbs_done = {words.split()[0] for words in chain.done}
    assert {"plan", "simulate"} <= verbs_done
    assert len(chain.done) >= 3
