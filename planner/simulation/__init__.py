"""A plan's run as it would be measured on a robot with known errors: a smoke test of the chain, not a proof of it."""

from planner.simulation.impossible import told_impossible
from planner.simulation.measuring import RATE, SimulatedRun, samples_of, simulate
from planner.simulation.truth import Truth, drawn, read_truth

__all__ = ["RATE", "SimulatedRun", "Truth", "drawn", "read_truth", "samples_of", "simulate", "told_impossible"]
