"""A cell, courses and evaluations that several tests look at, made once."""

from functools import cache
from pathlib import Path

import numpy as np

import tests.loaded.world as world
from planner.cell.reading import load_cell
from planner.fit.run_setup import setup_for_run
from planner.loaded.evaluation import evaluate_loaded_circles
from planner.runs.run import Readings, Run, Samples

CELL = "abb-irb6700/ldbb"
ERRORS = {"theta2": 3e-4, "theta3": -4e-4, "a2": 4e-4, "d4": 3e-4, "alpha3": 3e-4, "theta5": 5e-4, "alpha1": 2e-4}


@cache
def cell():
    return load_cell(CELL, planning=False)


@cache
def arm():
    return world.arm()


@cache
def course(**settings):
    return world.course(arm(), **settings)


def run_of(way, length, force=None, places=("A",), place=0):
    n = len(length)
    samples = Samples(
        q=way.q, place=np.full(n, place), t=way.t, session=np.zeros(n, int), force=way.force if force is None else force
    )
    return Run("made", samples, Readings(length=length), places, continuous=True, robot="abb-irb6700")


def setup(run):
    return setup_for_run(cell(), run)


@cache
def evaluated(seed=0, rough=True):
    """World, course and evaluation of one run with errors, repeatability and reversal."""
    truth = world.World(errors=ERRORS if rough else {}, wander=4e-6 if rough else 0.0, reversal=1e-5 if rough else 0.0)
    way = course()
    length, _ = world.readings(arm(), truth, way, np.random.default_rng(seed))
    return truth, way, evaluate_loaded_circles(run_of(way, length), cell())


def cell_text():
    return (Path(__file__).resolve().parents[2] / "robots" / "abb-irb6700" / "cells" / "ldbb.toml").read_text()
