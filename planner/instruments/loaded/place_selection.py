"""Predicted information on the compliances by a loaded circle at each place, and the best places together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup, setup_of
from planner.common.determinism import on_one_thread
from planner.common.units import Array, read_only
from planner.design.selection.d_optimal import detmax
from planner.effects.compliance import compliance_parameters
from planner.instruments.loaded.circle_candidates import (
    CirclePlace,
    find_circle_places,
    find_own_place,
)
from planner.instruments.loaded.compliance import harmonic_counts, harmonics_of
from planner.instruments.loaded.types import AveragedCurves, DrivenCircle
from planner.model.model import Model
from planner.runs.run import Samples

SMOOTH = 8  # harmonics over which the arm's repeatability along a circle is spread
TYPICAL_SHARE = 0.5  # part of its prior size by which each joint is taken to yield, for what the fixture's height does


@dataclass(frozen=True)
class PredictedCompliance:
    """What some circles would tell: standard deviation with the prior (N,), and without (N,), per prior size."""

    std: Array
    alone: Array

    @property
    def worst(self) -> float:
        """Of the joint known least, with the prior."""
        return float(self.std.max())


@dataclass(frozen=True)
class CirclePlaceChoice:
    """Candidates, what each tells, and the best sets of one, two, … places.

    Attributes:
        names: of the compliances; prior (N,) [rad/Nm].
        pool: the candidates; information: of each in prior sizes, (M, N, N).
        own: what the cell's own circle tells.
        sets: positions in the pool of the best 1, 2, … places; known: what each set tells.
    """

    names: tuple[str, ...]
    prior: Array
    pool: tuple[CirclePlace, ...]
    information: Array
    own: PredictedCompliance
    sets: tuple[np.ndarray, ...]
    known: tuple[PredictedCompliance, ...]

    def best(self, count: int) -> list[CirclePlace]:
        """Return the best set of ``count`` places."""
        return [self.pool[int(i)] for i in self.sets[count - 1]]


def select_circle_places(
    cell: Cell, pool: Sequence[CirclePlace], own: CirclePlace, most: int, seed: int = 0
) -> CirclePlaceChoice:
    """Choose the places whose circles know the compliances best together (largest determinant, DETMAX)."""
    setup = setup_of(cell)
    stiff = compliance_parameters(setup)
    prior = np.array([p.prior for p in stiff])
    information = np.array([predict_information(setup, c) for c in pool]) * np.outer(prior, prior)
    rows = np.array([_information_root(block) for block in information])
    sets = tuple(detmax(rows, k, seed=seed) for k in range(1, min(most, len(pool)) + 1))
    return CirclePlaceChoice(
        tuple(p.name for p in stiff),
        read_only(prior),
        tuple(pool),
        read_only(information),
        predict_compliance(predict_information(setup, own) * np.outer(prior, prior)),
        sets,
        tuple(predict_compliance(information[s].sum(axis=0)) for s in sets),
    )


def predict_information(setup: MeasurementSetup, place: CirclePlace) -> Array:
    """Information of the compliances by one circle driven as the cell's own, (N, N) [(Nm/rad)²].

    It is the one that the evaluation finds, with the noise that gauge and repeatability promise.
    """
    circle = place.circle
    curves = planned_curves(setup, place)
    there = replace(setup, p_BX=place.p_BX[None], place_names=(circle.name,), place_prior=setup.place_prior[:1])
    model = Model(there, tuple(compliance_parameters(setup)))
    waves = harmonics_of(model, curves, TYPICAL_SHARE * model.prior)
    return waves.information(curves.noise, float(setup.place_prior[circle.fixture])).information


def planned_curves(setup: MeasurementSetup, place: CirclePlace) -> AveragedCurves:
    """Return the curves that a circle would give, without their readings."""
    circle = place.circle
    D, K, B = len(circle.directions), len(circle.loads), len(place.q)
    loads, shape = np.array(circle.loads), (D, K, B)
    axes = np.stack([*circle.axes, place.axis_B])
    where = DrivenCircle(circle.p_BC, read_only(axes), circle.radius, place.p_BX, circle.name, 0)
    there = replace(setup, p_BX=place.p_BX[None])
    return AveragedCurves(
        circle=where,
        theta=read_only(np.arange(B) * 2 * np.pi / B),
        directions=(1, -1)[:D],
        loads=read_only(loads),
        q=read_only(np.broadcast_to(place.q, (*shape, place.q.shape[1]))),
        length=read_only(np.zeros(shape)),
        force=read_only(np.broadcast_to(loads[:, None], shape)),
        noise=read_only(promised_turn_noise(there, place.q)),
        repeats=np.full((D, K), circle.repeats),
    )


def promised_turn_noise(setup: MeasurementSetup, q: Array) -> Array:
    """Variance of one turn's harmonics, (H,) [m²]: the gauge's in all, the arm's repeatability in the first few."""
    B = len(q)
    noise = Model(setup, ()).reading_noise(Samples.at(q))
    count = harmonic_counts(B)
    few = np.zeros(len(count))
    few[:SMOOTH] = float(noise.robot_variance.mean()) * count.sum() / count[:SMOOTH].sum()
    return np.asarray(few + noise.gauge_variance)


def predict_compliance(information: Array) -> PredictedCompliance:
    """Return what an information in prior sizes (N, N) says of each compliance."""
    size = np.diag(np.linalg.inv(information + np.eye(len(information))))
    alone = np.diag(np.linalg.inv(information + 1e-12 * np.trace(information) * np.eye(len(information))))
    return PredictedCompliance(read_only(np.sqrt(size)), read_only(np.sqrt(alone)))


def _information_root(block: Array) -> Array:
    """Rows J (N, N) with JᵀJ the information."""
    size, axes = np.linalg.eigh(block)
    return np.asarray(np.sqrt(np.maximum(size, 0.0))[:, None] * axes.T)


@on_one_thread
def study_circle_places(cell: Cell, most: int = 6, seed: int = 0) -> CirclePlaceChoice:
    """Find where up to ``most`` loaded circles tell the compliances of a cell's arm apart.

    Raises:
        InputError: the cell has no circle under load.
        NoSolutionError: no circle can be followed.
    """
    return select_circle_places(cell, find_circle_places(cell, seed), find_own_place(cell, seed), most, seed)
