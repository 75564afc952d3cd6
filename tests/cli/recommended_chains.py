"""What the screens recommend, done to its end: from a cell to the last command that is named, without a person.

``python -m tests.cli.recommended_chains -j 16`` drives a chain for each shipped cell, each command in a process of its
own, and prints a line for each chain as it ends (``--seeds 1 2``: with two seeds; ``-k kuka``: of some cells;
``--minutes 9``: what is not begun by then is named, what runs is ended). Cells have few candidates and few poses: that
the commands that are named work is seen here, how good their plans are elsewhere. What a person would fill in
(``CELL``, ``PROGRAM``, ``RECORD`` …) is filled in as the pages say. No network.
"""

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell, shipped_cells
from planner.cli.app import verbs
from planner.common.errors import PARTLY_DONE
from tests.golden.cases import shipped

NAMED = re.compile(r"\bedbb (?P<verb>[a-z]+(?:-[a-z]+)*) (?P<rest>[^();\n]*?-o \S+?)(?=[);,]?(?:\s|$))")
BY_HAND = {"measure", "centre", "export", "serve", "import"}  # need a gauge, a robot or a person's files
FEW = "candidates = 800\nvalidate = 4\nrefine = false"
POSES = 48  # of a first session: enough to fit, few enough to plan in a minute, shared evenly by 2, 3 or 4 balls
WITHOUT_CIRCLES = {"comau-nj130/circular": "comau-nj130/edbb"}  # where poses show the causes of what circles show
LOADED = "abb-irb6700/ldbb"
OF_CIRCLES = {"comau-nj130/circular", LOADED}  # have no poses to be chosen
MOST = 14  # commands of one chain
ENDS = {0, PARTLY_DONE}  # the second: lines of a program that were left are named
LONGEST_S = 400.0  # of one command


class ChainError(AssertionError):
    """A command that was named did not end well."""


@dataclass
class Chain:
    """The commands that were named and those that were done, in a folder of their own; ``until``: by the clock [s]."""

    folder: Path
    cell: str
    seed: int
    until: float = float("inf")
    done: list = field(default_factory=list)
    named: list = field(default_factory=list)

    def do(self, words):
        """Do a command as it is typed, and note what its screen names."""
        self.done.append(shlex.join(words))
        told = self._run(words)
        if told.returncode not in ENDS:
            raise ChainError(f"{' && '.join(self.done)}\nexit code {told.returncode}: {told.stderr}")
        self.named += [words for words in commands_in(told.stdout + told.stderr) if words not in self.named]

    def _run(self, words):
        left = min(LONGEST_S, self.until - time.monotonic())
        try:
            return subprocess.run(
                [sys.executable, "-m", "planner.cli", *words],
                capture_output=True, text=True, cwd=self.folder, check=False, timeout=max(left, 1.0),
                env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ChainError(f"{' && '.join(self.done)}\nnot done after {left:.0f} s") from None

    def fill(self, words):
        """Return the words of a named command with what a person fills in."""
        plan = "circles_free.toml" if self.cell in WITHOUT_CIRCLES else "plan/cell.toml"
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
            both = "FREE.csv" in words  # of a plan of both: tests/loaded/test_command.py fits the two
            if other or both or words[0] in BY_HAND or len(self.done) >= MOST:
                continue
            self.measure(words)
            self.do(self.fill(words))

    def measure(self, words):
        """Simulate the run that a command is to evaluate, where a gauge at the robot would have measured it."""
        plan = words[words.index("--plan") + 1] if "--plan" in words else ""
        if words[0] != "simulate" and plan and not (self.folder / words[1]).exists():
            self.do(["simulate", plan, "-o", words[1], "--seed", str(self.seed)])


def commands_in(text):
    """The commands that a screen names, as words: each up to its output, as it would be copied."""
    found = ((m["verb"], *m["rest"].split()) for m in NAMED.finditer(text))
    return [words for words in dict.fromkeys(found) if words[0] in verbs()]


def drive_chain(name, seed, folder, until=float("inf")):
    """Plan a session of a shipped cell, and follow what the screens name from there.

    Raises:
        ChainError: a command fails, or takes too long.
    """
    chain = Chain(folder, name, seed, until)
    home = np.rad2deg(load_cell(name, planning=False).home)
    (folder / "cell.toml").write_text(shipped(name, plan="" if name in OF_CIRCLES else FEW))
    if name in WITHOUT_CIRCLES:
        (folder / "circles_free.toml").write_text(shipped(WITHOUT_CIRCLES[name], plan=FEW))
    titles = ",".join(f"q{i}_deg" for i in range(1, len(home) + 1))
    rows = "\n".join(",".join(f"{v + step:.4f}" for v in home) for step in (0.0, 2.0, -2.0))
    (folder / "targets.csv").write_text(f"{titles}\n{rows}\n")
    poses = () if name in OF_CIRCLES else ("--poses", str(POSES))
    chain.do(["plan", "cell.toml", "-o", "plan", "--seed", str(seed), *poses])
    chain.follow()
    return chain


def _tried(name, seed, until):
    """A line of the table, and what went wrong; a chain is not begun after its time."""
    begun = time.monotonic()
    if begun > until:
        return f"NOT BEGUN  {name} seed {seed}", ""
    with tempfile.TemporaryDirectory() as folder:
        try:
            chain = drive_chain(name, seed, Path(folder), until)
        except ChainError as err:
            return f"FAILED     {name} seed {seed}  after {time.monotonic() - begun:.0f} s", str(err)
    kinds = " ".join(words.split()[0] for words in chain.done)
    return f"done       {name} seed {seed}  {time.monotonic() - begun:.0f} s: {kinds}", ""


def main():
    """Drive the chains and print how each ended."""
    asked = argparse.ArgumentParser(description="Drive what the screens recommend to its end, for each shipped cell.")
    asked.add_argument("-j", type=int, default=2, help="chains at a time")
    asked.add_argument("-k", default="", help="cells whose name holds this, several separated by commas")
    asked.add_argument("--seeds", type=int, nargs="+", default=[1])
    asked.add_argument("--minutes", type=float, default=60.0, help="after which nothing goes on")
    said = asked.parse_args()
    until = time.monotonic() + 60.0 * said.minutes
    parts = said.k.split(",")
    chains = [(name, seed) for seed in said.seeds for name in shipped_cells() if any(part in name for part in parts)]
    wrong = 0
    with ThreadPoolExecutor(said.j) as pool:
        for line in as_completed([pool.submit(_tried, name, seed, until) for name, seed in chains]):
            row, why = line.result()
            wrong += not row.startswith("done")
            print("\n".join([row, *(f"    {text}" for text in why.splitlines())]), flush=True)
    print(f"{len(chains) - wrong} of {len(chains)} chains done to their end", flush=True)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
