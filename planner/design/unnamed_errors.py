"""The errors that nobody has declared, and beside them those that the catalogue has no name for.

An arm may turn in its parts as no effect of the catalogue says. Poses about one fixture show that in part only, so that
a model without it is surer of the rest of the workspace than it may be (Kennedy and O'Hagan 2001, J. R. Statist. Soc.
B 63(3)). Each family of such turns is many columns, nearly alike over the poses and the workspace: it enters by the few
mixtures of them that act there.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag, eigh

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread
from planner.common.units import Array, read_only
from planner.design.expected_errors import ExpectedErrors
from planner.design.free_parameters import ASSUMED, UndeclaredErrors
from planner.design.learnt_sizes import AT_TIMES, HARDLY_EVER, Families
from planner.effects.catalogue import Excitation
from planner.effects.misfit_shapes import shapes_without_catalogue
from planner.model.tool_error import ToolError
from planner.runs.run import Samples

UNNAMED = "unnamed"  # group of their parameters


@dataclass(frozen=True)
class UnnamedErrors(UndeclaredErrors):
    """Errors of unit size: those of :class:`UndeclaredErrors`, one a parameter, then mixtures without a name.

    Attributes:
        model: with the turns without a name behind all other parameters.
        mixtures: what each error does to the parameters, in their prior sigmas, (parameters, P).
        family: number of the family without a name of each error, (P,) int; −1 of those that have one.
        catalogued: which of these families the catalogue has a name for all the same, (F,) bool.
    """

    mixtures: Array
    family: np.ndarray
    catalogued: np.ndarray

    @property
    def root(self) -> Array:
        """Root of the prior covariance, (parameters, P)."""
        return np.asarray(self.prior[:, None] * self.mixtures)

    @property
    def of_gauge(self) -> np.ndarray:
        """Which errors only say where the gauge stands, (P,) bool."""
        gauge = np.zeros(len(self.family), dtype=bool)
        named = self.family < 0
        gauge[named] = [p.group == "gauge" for p in self.model.parameters[: int(named.sum())]]
        return gauge

    @cached_property
    def _weight_per_error(self) -> Array:
        return np.asarray(self.root.T @ self.weight @ self.root)

    @property
    def weight_per_prior(self) -> Array:
        """The weight for errors of unit size, (P, P) [m²]."""
        return self._weight_per_error

    def white(self, samples: Samples) -> Array:
        """Return the rows of readings in standard deviations per error, (n r, P)."""
        return self.model.reading_noise(samples).white(self.model.rows(samples) @ self.root)


@dataclass(frozen=True)
class IdentifiedErrors(UnnamedErrors):
    """The same as an identification meets them: it has to learn which of them act, and how large they are."""

    doubt: ClassVar[float] = 0.3  # with it, 19 of 20 of 60 arms that were drawn are below their limit
    assumptions: ClassVar[str] = f"{ASSUMED}. What else an identification allows for takes its share of the readings"


def identified_errors(unknown: ExpectedErrors, cell: Cell, samples: Samples) -> ExpectedErrors:
    """Return what poses ``samples`` leave unknown to an identification, where ``unknown`` chose them.

    Families without a name count by the mean of their squares: each has its usual size as often as it acts. Of a robot
    that was calibrated before, its own posterior says all this.
    """
    if not isinstance(unknown, UndeclaredErrors):
        return unknown
    there = add_unnamed_errors(unknown, cell, samples)
    often, hardly = (act / of for act, of in (Families.SEEN_TO_ACT[kind] for kind in (AT_TIMES, HARDLY_EVER)))
    acts = np.append(np.where(there.catalogued, often, hardly), 1.0)[there.family]  # the last is of those with a name
    own = {f.name: getattr(there, f.name) for f in fields(there)}
    found = IdentifiedErrors(**own | {"mixtures": read_only(there.mixtures * np.sqrt(acts))})
    return replace(found, untraced_error=_geometry_alone(found, found.white(samples)))


def _geometry_alone(errors: UnnamedErrors, white: Array) -> float:
    """Return the error of the tool [m] that readings ``white`` (n, P) leave where gauge and geometry alone are fitted.

    The fit takes all other errors for noise of the gauge.
    """
    named = int((errors.family < 0).sum())
    fitted = np.zeros(white.shape[1], dtype=bool)
    fitted[:named] = [not p.is_effect for p in errors.model.parameters[:named]]
    own = white[:, fitted]
    gain = np.zeros(white.T.shape)
    gain[fitted] = np.linalg.solve(own.T @ own + np.eye(own.shape[1]), own.T)
    left = np.eye(white.shape[1]) - gain @ white
    return errors.state(float((errors.weight_per_prior * (left @ left.T + gain @ gain.T)).sum()))


@on_one_thread
def add_unnamed_errors(declared: UndeclaredErrors, cell: Cell, samples: Samples) -> UnnamedErrors:
    """Return undeclared errors with those that the catalogue has no name for, as far as ``samples`` tell of any."""
    run = Excitation.of(declared.model.setup, samples)
    shapes = list(shapes_without_catalogue(run))
    turns = [[replace(p, group=UNNAMED) for p in own] for _, own, _ in shapes]
    count, unnamed = len(declared.prior), [p for own in turns for p in own]
    model = declared.model.plus(unnamed)
    prior = np.concatenate([declared.prior, [p.prior for p in unnamed]])
    weight = ToolError.of(cell, [p for p in model.parameters if p.is_effect]).weight(model.names)
    rows = replace(model, parameters=model.parameters[count:]).rows(samples) * prior[count:]
    moved = weight[count:, count:] * np.outer(prior[count:], prior[count:])
    parts = [slice(a, b) for a, b in pairwise(np.cumsum([0, *map(len, turns)]).tolist())]
    mixtures = [
        _strongest_mixtures(np.einsum("nri,nrj->ij", rows[..., own], rows[..., own]), moved[own, own]) for own in parts
    ]
    family = np.concatenate([np.full(count, -1), *(np.full(m.shape[1], k) for k, m in enumerate(mixtures))])
    return UnnamedErrors(
        model, read_only(prior), read_only(weight), declared.untraced_error,
        read_only(block_diag(np.eye(count), *mixtures)), family, np.array([named for _, _, named in shapes]),
    )  # fmt: skip


def _strongest_mixtures(shown: Array, moved: Array) -> Array:
    """Return the mixtures (m, k) of m turns, of unit size, that make up nearly all that they do together.

    Args:
        shown: sum of squares of what they do to the readings, (m, m).
        moved: mean square of what they do to the tool, (m, m).
    """
    both = sum(part / max(float(np.trace(part)), 1e-300) for part in (shown, moved))
    values, axes = eigh(both)
    share = np.cumsum(np.maximum(values[::-1], 0.0))
    kept = int(np.searchsorted(share, 0.98 * share[-1])) + 1  # of all that they do
    return np.asarray(axes[:, ::-1][:, :kept])
