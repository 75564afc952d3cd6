"""What a loaded circle at each place would tell of the compliances, and which few places tell most together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.loaded import Curves
from planner.loaded.compliance import waves_of
from planner.loaded.harmonics import counts
from planner.loaded.types import Circle
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.rig import Rig, rig_of
from planner.selection import detmax
from planner.study.softness.circles import Candidate, own_circle
from planner.units import Array, frozen

SMOOTH = 8  # harmonics over which the arm's repeatability along a circle is spread
TYPICAL = 0.5  # part of its prior size by which each joint is taken to yield, for what the fixture's height does


@dataclass(frozen=True)
class Known:
    """What some circles would tell: standard deviation with the prior (N,), and without (N,), per prior size."""

    std: Array
    alone: Array

    @property
    def worst(self) -> float:
        """Of the joint known least, with the prior."""
        return float(self.std.max())


@dataclass(frozen=True)
class Places:
    """Candidates, what each tells, and the best sets of one, two, … places.

    Attributes:
        names: of the compliances; prior (N,) [rad/Nm].
        pool: the candidates; information: of each in prior sizes, (M, N, N).
        own: what the cell's own circle tells.
        sets: positions in the pool of the best 1, 2, … places; known: what each set tells.
    """

    names: tuple[str, ...]
    prior: Array
    pool: tuple[Candidate, ...]
    information: Array
    own: Known
    sets: tuple[np.ndarray, ...]
    known: tuple[Known, ...]


def choose_places(cell: Cell, pool: Sequence[Candidate], own: Candidate, most: int, seed: int = 0) -> Places:
    """Choose the places whose circles know the compliances best together (largest determinant, DETMAX)."""
    rig = rig_of(cell)
    stiff = compliance_parameters(rig)
    prior = np.array([p.prior for p in stiff])
    information = np.array([predicted(cell, rig, c) for c in pool]) * np.outer(prior, prior)
    rows = np.array([_root(block) for block in information])
    sets = tuple(detmax(rows, k, seed=seed) for k in range(1, min(most, len(pool)) + 1))
    return Places(
        tuple(p.name for p in stiff),
        frozen(prior),
        tuple(pool),
        frozen(information),
        known_by(predicted(cell, rig, own) * np.outer(prior, prior)),
        sets,
        tuple(known_by(information[s].sum(axis=0)) for s in sets),
    )


def predicted(cell: Cell, rig: Rig, place: Candidate) -> Array:
    """Information of the compliances by one circle driven as the cell's own, (N, N) [(Nm/rad)²].

    It is the one that the evaluation finds, with the noise that gauge and repeatability promise.
    """
    circle = own_circle(cell)
    curves = planned_curves(cell, rig, place)
    there = replace(rig, p_BX=place.p_BX[None], place_names=(circle.name,), place_prior=rig.place_prior[:1])
    model = Model(there, tuple(compliance_parameters(rig)))
    waves = waves_of(model, curves, TYPICAL * model.prior)
    return waves.told(curves.noise, float(rig.place_prior[circle.fixture])).information


def planned_curves(cell: Cell, rig: Rig, place: Candidate) -> Curves:
    """Return the curves that a circle would give, without their readings."""
    circle = own_circle(cell)
    D, K, B = len(circle.directions), len(circle.loads), len(place.q)
    loads = np.array(circle.loads)
    shape = (D, K, B)
    first, second = place.q, np.arange(B) * 2 * np.pi / B
    axes = np.stack([*(np.eye(3)["XYZ".index(a)] for a in circle.plane), place.axis_B])
    where = Circle(circle.name, 0, place.centre, frozen(axes), circle.radius, place.p_BX)
    there = replace(rig, p_BX=place.p_BX[None])
    return Curves(
        circle=where,
        theta=frozen(second),
        directions=(1, -1)[:D],
        loads=frozen(loads),
        q=frozen(np.broadcast_to(first, (*shape, first.shape[1]))),
        length=frozen(np.zeros(shape)),
        force=frozen(np.broadcast_to(loads[:, None], shape)),
        noise=frozen(turn_noise_promised(there, place.q)),
        repeats=np.full((D, K), circle.repeats),
    )


def turn_noise_promised(rig: Rig, q: Array) -> Array:
    """Variance of one turn's harmonics, (H,) [m²]: the gauge's in all, the arm's repeatability in the first few."""
    B = len(q)
    model = Model(rig, ())
    arm = float(np.mean(model.noise(q) ** 2)) - rig.noise**2
    count = counts(B)
    few = np.zeros(len(count))
    few[:SMOOTH] = arm * count.sum() / count[:SMOOTH].sum()
    return np.asarray(few + rig.noise**2)


def known_by(information: Array) -> Known:
    """Return what an information in prior sizes (N, N) says of each compliance."""
    size = np.diag(np.linalg.inv(information + np.eye(len(information))))
    alone = np.diag(np.linalg.inv(information + 1e-12 * np.trace(information) * np.eye(len(information))))
    return Known(frozen(np.sqrt(size)), frozen(np.sqrt(alone)))


def _root(block: Array) -> Array:
    """Rows J (N, N) with JᵀJ the information."""
    size, axes = np.linalg.eigh(block)
    return np.asarray(np.sqrt(np.maximum(size, 0.0))[:, None] * axes.T)
