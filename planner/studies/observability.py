"""What one's own poses show: Jacobian, singular vectors, indices, covariance; and poses that an index chooses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from planner.cell.cell import Cell
from planner.cell.placement import FREEABLE
from planner.cell.reading import load_cell
from planner.common.choices import IndexName
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, did_you_mean
from planner.common.lazy_modules import pl
from planner.common.units import DEG, MM, Array, read_only
from planner.design.candidates.balls import draw_pose_candidates
from planner.design.free_parameters import planned_model, preference_order
from planner.design.observability.identifiability import Identifiability, find_identifiable
from planner.design.observability.information import Covariance, all_indices, find_rule, predict_covariance
from planner.design.pose_selection import identify_candidates
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_search import exchange_poses
from planner.effects.catalogue import effect_kinds
from planner.effects.effect import Parameter
from planner.model.model import Model
from planner.model.own_priors import with_priors
from planner.runs.run import Run, Samples
from planner.runs.writer import frame_angles

if TYPE_CHECKING:
    import polars

Scaling = Literal["prior", "m, rad", "mm, deg", "columns"]
"""Units of the columns: per prior sigma (free of units), SI, mm and degrees, or each of length one."""
SCALINGS: tuple[Scaling, ...] = ("prior", "m, rad", "mm, deg", "columns")
Poses = Any  # an array (n, N) [rad], a data frame with q1_deg …, a run, or Samples


@dataclass(frozen=True)
class Observability:
    """What a set of poses shows.

    Attributes:
        cell: where they are measured.
        samples: the poses, and how the gauge is held there.
        model: of all parameters that are free.
        jacobian: change of each reading by each parameter, (n, r, P) [m or rad per unit of the parameter].
        noise: standard deviation of each reading, (n,) [m or rad], the robot's repeatability included.
        seen: which parameters the readings tell apart, and why the others are left out.

    Example:
        >>> seen = observability("comau-nj130/edbb", q)  # q (n, 6) rad  # doctest: +SKIP
        >>> seen.jacobian.shape  # (n, 1, P) for a bar  # doctest: +SKIP
    """

    cell: Cell
    samples: Samples
    model: Model
    jacobian: Array
    noise: Array
    seen: Identifiability

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all free parameters, (P,), in the order of the columns."""
        return self.model.names

    @property
    def units(self) -> tuple[str, ...]:
        """Their units, of the SI."""
        return tuple(p.unit for p in self.model.parameters)

    @property
    def rank(self) -> int:
        """How many parameters the readings tell apart, by noise and priors too; see :attr:`numerical_rank`."""
        return self.seen.rank

    @property
    def numerical_rank(self) -> int:
        """Rank of the Jacobian per prior sigma by rounding alone (singular values above P ε of the largest)."""
        mu = self.singular_values("prior")
        return int((mu > mu[0] * max(self._tall.shape) * np.finfo(float).eps).sum())

    @property
    def _tall(self) -> Array:
        return self.jacobian.reshape(-1, self.jacobian.shape[2])

    def scale(self, scaling: Scaling) -> Array:
        """Return by what each column is multiplied, (P,).

        Raises:
            InputError: no such scaling.
        """
        if scaling not in SCALINGS:
            raise InputError(f"scaling '{scaling}' is unknown: it is one of {', '.join(map(repr, SCALINGS))}")
        if scaling == "prior":
            return self.model.prior
        if scaling == "mm, deg":  # readings in mm, so per mm or degree
            return np.array([{"m": 1.0, "rad": DEG / MM}.get(u, 1.0 / MM) for u in self.units])
        size = np.linalg.norm(self._tall, axis=0)
        return np.ones(len(self.names)) if scaling == "m, rad" else 1.0 / np.where(size > 0, size, 1.0)

    def singular_values(self, scaling: Scaling = "prior") -> Array:
        """Return the singular values of the stacked Jacobian, descending, (P,)."""
        return self.svd(scaling)[1]

    def singular_vectors(self, scaling: Scaling = "prior") -> Array:
        """Return the right singular vectors as columns, (P, P), in scaled parameters; the last are seen least."""
        return self.svd(scaling)[2].T

    def svd(self, scaling: Scaling = "prior") -> tuple[Array, Array, Array]:
        """Return U (n r, P), singular values (P,) and Vᵀ (P, P) of the stacked, scaled Jacobian (numpy)."""
        tall = self._tall * self.scale(scaling)
        lacking = max(0, tall.shape[1] - len(tall))
        U, mu, Vt = np.linalg.svd(np.vstack([tall, np.zeros((lacking, tall.shape[1]))]), full_matrices=False)
        return U[: len(tall)], mu, Vt

    @property
    def null_vectors(self) -> tuple[dict[str, float], ...]:
        """Directions that no reading shows, one for each dropped parameter: shares by name (m, rad), length one."""
        return tuple(dict(d.direction) for d in self.seen.dropped)

    def indices(self, scaling: Scaling = "prior") -> dict[str, float]:
        """Return O1 … O5 over the parameters that are told apart, in a scaling.

        O1 is divided by the root of the number of poses; O2 and O4 depend on the scaling most. Readings are in m (in mm
        with "mm, deg").
        """
        kept = list(self.seen.kept)
        return all_indices(self.jacobian[:, :, kept], self.scale(scaling)[kept])

    @cached_property
    def white_rows(self) -> Array:
        """Rows of the parameters that are told apart, in standard deviations of a reading, (n r, p)."""
        noise = self.model.reading_noise(self.samples)
        width = self.jacobian.shape[1]
        variance = np.broadcast_to(noise.gauge_variance, self.jacobian.shape[:2])
        root = np.linalg.cholesky(noise.robot_covariance + variance[:, :, None] * np.eye(width))
        rows = np.linalg.solve(root, self.jacobian[:, :, list(self.seen.kept)])
        return np.asarray(rows.reshape(-1, rows.shape[2]))

    @property
    def seen_parameters(self) -> tuple[Parameter, ...]:
        """The parameters that are told apart, (p,): those of :attr:`covariance`."""
        return tuple(self.model.parameters[k] for k in self.seen.kept)

    def covariance(self, with_priors: bool = False) -> Covariance:
        """Return the covariance of the kept parameters after measuring each pose once, in their units.

        Args:
            with_priors: whether each prior counts as one further reading (a Bayesian fit).

        Raises:
            InputError: without priors the poses leave a direction unseen.
        """
        prior = np.array([p.prior for p in self.seen_parameters]) if with_priors else None
        return predict_covariance(self.white_rows[:, None, :], 1.0, prior)

    def to_frame(self) -> "polars.DataFrame":
        """Return one row a parameter: unit, prior, whether it is seen and why not, predicted sigma (with priors)."""
        std = dict(zip((p.name for p in self.seen_parameters), self.covariance(with_priors=True).std, strict=True))
        why = {d.name: d.because for d in self.seen.dropped}
        rows = [
            {"parameter": p.name, "unit": p.unit, "prior": p.prior, "seen": p.name in std}
            | {"sigma": None if p.name not in std else float(std[p.name]), "because": why.get(p.name, "")}
            for p in self.model.parameters
        ]
        return pl.DataFrame(rows, infer_schema_length=None)

    @on_one_thread
    def d_efficiency(self, candidates: int = 2000, seed: int = 0) -> tuple[float, float]:
        """Return the D-efficiency (0 … 1) of the poses, and the proven bound that it is measured by, of O1.

        Any set of poses out of these and ``candidates`` drawn ones, of any size, has an O1 below the bound (in m, rad).
        The efficiency is (O1 / bound)²: the share of readings that as good a set would need.
        """
        kept = list(self.seen.kept)
        pool = draw_pose_candidates(self.cell, candidates, seed)
        rows = np.concatenate([self.jacobian[:, :, kept], self.model.rows(pool.samples)[:, :, kept]])
        bound = certify_bound(rows, "O1", None, seed=seed).value
        return float((self.indices("m, rad")["O1"] / bound) ** 2), float(bound)

    def __repr__(self) -> str:
        """Say how much is seen of what."""
        return f"<Observability: {self.rank} of {len(self.names)} parameters by {len(self.samples)} poses>"


@on_one_thread
def observability(
    cell: Cell | Path | str,
    poses: Poses,
    *,
    free: Sequence[str] | None = None,
    priors: Mapping[str, float] | None = None,
    fixture: int | Sequence[int] = 0,
) -> Observability:
    """Return what poses of one's own show in a cell, with any gauge that it has.

    Args:
        cell: a cell, its path, or ``robot/cell`` of a shipped one.
        poses: model angles (n, N) [rad]; or a data frame with ``q1_deg`` … (polars, pandas, any that
            speaks Arrow); or a run; or :class:`planner.runs.run.Samples`.
        free: parameters by name (``theta2``), or ``fixture``, ``tool``, ``zero``, ``geometry``, or kinds of effects
            for whole groups; the cell's own by default.
        priors: one-sigma sizes by parameter and unit, such as ``{"theta2_deg": 0.05}``, in place of the cell's.
        fixture: in which fixture the gauge is held, counted from 0, one for all or one for each pose of an array.

    Raises:
        InputError: the shapes do not fit, a parameter is unknown, or no reading depends on any of them.

    Example:
        >>> import numpy as np
        >>> from planner import load_cell, observability
        >>> cell = load_cell("kuka-kr6-r700/tracker")
        >>> q = np.random.default_rng(0).uniform(-0.5, 0.5, (30, 6)) + cell.home
        >>> observability(cell, q).jacobian.shape[:2]
        (30, 3)
    """
    site = with_priors(cell if isinstance(cell, Cell) else load_cell(cell), priors)
    samples = pose_samples(site, poses, fixture)
    model = _free_model(site, samples, free)
    rows, noise = model.rows(samples), model.noise(samples)
    seen = find_identifiable(
        rows, model.names, model.prior, preference_order(model), float(np.median(noise)), rows[..., 0].size
    )
    return Observability(site, samples, model, read_only(rows), read_only(noise), seen)


def _free_model(cell: Cell, samples: Samples, free: Sequence[str] | None) -> Model:
    """Return the model of the parameters, groups and effects that are named; of the cell's own by default."""
    if free is None:
        return planned_model(cell, samples)
    known = Model.from_cell(cell, FREEABLE)
    offered = [*known.names, *FREEABLE, "geometry", *effect_kinds()]
    if strange := [name for name in free if name not in offered]:
        hint = did_you_mean(strange[0], offered) or f" (there are {', '.join(offered)})"
        raise InputError(f"free: '{strange[0]}' is no parameter, group or effect{hint}")
    effects = [name for name in free if name not in known.names and name not in (*FREEABLE, "geometry")]
    plan = replace(cell.plan, free=FREEABLE, effects=tuple(effects))
    whole = planned_model(replace(cell, plan=plan), samples)
    groups = {group: set(known.names) - set(Model.from_cell(cell, FREEABLE - {group}).names) for group in FREEABLE}
    groups["geometry"] = {p.name for p in known.parameters if p.group == "geometry"}
    wanted = set[str]().union(*(groups.get(name, {name}) for name in free))
    kept = [k for k, p in enumerate(whole.parameters) if p.name in wanted or p.group in effects]
    return whole.subset(kept)


def pose_samples(cell: Cell, poses: Poses, fixture: int | Sequence[int] = 0) -> Samples:
    """Return poses of any form as samples; see :func:`observability`.

    Raises:
        InputError: they do not fit the robot.
    """
    if isinstance(poses, Samples | Run):
        return poses.samples if isinstance(poses, Run) else poses
    count = cell.robot.n_joints
    q = poses if isinstance(poses, np.ndarray | list | tuple) else frame_angles(poses, cell.robot.joint_columns("q"))
    angles = np.atleast_2d(np.asarray(q, dtype=float))
    if angles.ndim != 2 or angles.shape[1] != count or not np.isfinite(angles).all():
        raise InputError(f"poses have the shape {np.shape(q)}: (n, {count}) finite angles [rad] are needed")
    places = np.broadcast_to(np.asarray(fixture, dtype=int), len(angles))
    most = max(1, len(cell.fixtures))
    if places.min(initial=0) < 0 or places.max(initial=0) >= most:
        raise InputError(f"fixture = {fixture}: the cell has {most}, counted from 0")
    at = Samples.at(read_only(angles))
    return replace(at, place=read_only(places.copy(), int))


@dataclass(frozen=True)
class SelectedPoses:
    """Poses that an index chose among candidates.

    Attributes:
        cell: where they are measured.
        index: O1 … O5.
        samples: the chosen poses; ``q`` (n, N) [rad] of them.
        value: the index of them, raw (m, rad), over the identifiable parameters.
        certificate: no set of as many candidates is better than its value.

    Example:
        >>> chosen = select("comau-nj130/edbb", 40, "O1")  # doctest: +SKIP
        >>> chosen.q.shape  # (40, 6)  # doctest: +SKIP
        >>> chosen.observability().d_efficiency()  # doctest: +SKIP
    """

    cell: Cell
    index: IndexName
    samples: Samples
    value: float
    certificate: Certificate

    @property
    def q(self) -> Array:
        """Model angles, (n, N) [rad]."""
        return self.samples.q

    @property
    def bound(self) -> float:
        """What no set of as many candidates beats."""
        return self.certificate.value

    @property
    def gap(self) -> float:
        """How far the value is from the bound, as a share."""
        return find_rule(self.index).gap(self.value, self.bound)

    def observability(self) -> Observability:
        """Return what the chosen poses show."""
        return observability(self.cell, self.samples)

    def __repr__(self) -> str:
        """Say how good they are."""
        return f"<SelectedPoses: {len(self.q)} poses, {self.index} {self.value:.4g} in m, rad, bound {self.bound:.4g}>"


@on_one_thread
def select(
    cell: Cell | Path | str,
    n: int,
    criterion: IndexName = "O1",
    *,
    candidates: int = 2000,
    seed: int = 0,
    priors: Mapping[str, float] | None = None,
) -> SelectedPoses:
    """Choose ``n`` poses among candidates without collision by an index, with a proven bound (exchange).

    Args:
        cell: a cell, its path, or ``robot/cell`` of a shipped one.
        n: how many poses.
        criterion: O1 … O5.
        candidates: that compete; the plan itself looks among more.
        seed: the same seed gives the same poses.
        priors: as of :func:`observability`.

    Raises:
        InputError: too few poses for the parameters, or an unknown index.
        NoSolutionError: too few candidates pass the filters of the cell.

    Example:
        >>> from planner import select
        >>> select("ur10/edbb", 40, "O1", candidates=400)  # doctest: +SKIP
    """
    site = with_priors(cell if isinstance(cell, Cell) else load_cell(cell), priors)
    pool = draw_pose_candidates(site, candidates, seed)
    rows = identify_candidates(site, pool)[2]
    certificate = certify_bound(rows, find_rule(criterion).name, n, seed=seed)
    found = exchange_poses(rows, n, criterion, seed=seed, certificate=certificate)
    return SelectedPoses(site, criterion, pool.samples.take(found.chosen), float(found.value), certificate)
