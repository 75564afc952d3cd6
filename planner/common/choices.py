"""What a person chooses among, named alike in cell files, on the command line and in Python."""

from typing import Literal

Aim = Literal["index", "tracing"]
"""Poses by the observability index, or by the error that is left once hidden effects are traced."""

IndexName = Literal["O1", "O2", "O3", "O4", "O5"]
"""Observability index by which poses are selected."""

SelectionMethod = Literal["exchange", "pruning"]
"""How the index selects: poses exchanged until none betters it, or one taken away at a time (EDBB paper)."""

TourOrder = Literal["slowest-limit", "slowest-axis"]
"""What the order of the poses is the shortest of: the time of each segment's slowest limit, or of its slowest axis."""

SetUp = Literal["robot", "measured"]
"""How a fixture comes to its place: adjusted to the tool point where the robot drives it, or measured from the base."""

ReadBy = Literal["log", "hand", "trigger", "input", "centring"]
"""How a reading is taken where the robot rests at a pose: the gauge's own log runs through, a person reads it and lets
the robot go on, an output of the robot triggers it, an input tells that it is taken, a routine centres the gauge."""

TourSolver = Literal["auto", "exact", "concorde"]
"""What finds the shortest order of the poses: our own search as long as it pays, to the proof, or Concorde."""
