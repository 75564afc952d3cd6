"""The passes of a session in the order in which they are driven."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from planner.circular.types import Arc, Pass


def measured_passes(arcs: Sequence[Arc], number: int) -> Iterator[Pass]:
    """Every pass that is measured, in order, with marks at both ends of its sweep, counted from ``number``."""
    for k, arc in enumerate(arcs):
        there = arc.waypoints()
        for load in arc.circle.loads or (None,):
            for repeat in range(arc.circle.repeats):
                for direction in arc.circle.directions:
                    points = there if direction == "ccw" else there.reversed()
                    trajectory = arc.trajectory if direction == "ccw" else arc.back
                    ids = np.full(len(points.q), -1)
                    ids[np.flatnonzero(points.visit >= 0)] = (number, number + 1)
                    number += 2
                    yield Pass(k, direction, load, repeat, replace(points, visit=ids), trajectory)
