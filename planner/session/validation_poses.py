"""Poses that check a fit: where it has seen none."""

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.common.units import Array
from planner.effects.context import Context
from planner.runs.run import Samples


def order_by_distance(cell: Cell, q: Array, chosen: np.ndarray, seed: int) -> np.ndarray:
    """Return the candidates that were not chosen, (m,) int, those first that lie farthest from the chosen ones.

    Poses beside those that a fit has seen say nothing of the workspace. Each in turn is the one of some drawn blindly
    that is farthest from the chosen poses and from those before it. What was not drawn follows at random. Joints count
    by how far they move the tool.

    Args:
        cell, q: the cell and its candidates, (n, N) [rad].
        chosen: positions of the poses that are measured for the fit, (k,) int.
        seed: of the draw.
    """
    others = np.random.default_rng(seed).permutation(np.setdiff1d(np.arange(len(q)), chosen))
    context = Context(setup_of(cell), Samples.at(q))
    reach = np.sqrt((context.motion.point_screws(context.joints) ** 2).sum(axis=1).mean(axis=1))  # [m/rad]
    place = q * reach
    drawn, order = others[:400], list[int]()  # enough that some lie far out, few enough for a loop
    apart = np.full(len(drawn), np.inf)
    for k in chosen.tolist():
        apart = np.minimum(apart, np.linalg.norm(place[drawn] - place[k], axis=1))
    for _ in range(len(drawn)):
        k = int(np.argmax(apart))
        order.append(int(drawn[k]))
        apart = np.minimum(apart, np.linalg.norm(place[drawn] - place[drawn[k]], axis=1))
        apart[k] = -1.0
    return np.concatenate([np.array(order, dtype=int), others[400:]])
