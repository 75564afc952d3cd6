"""What a plan and the fit of its run free, what of it is preferred, and the errors that nobody has declared."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.common.errors import InputError, did_you_mean
from planner.common.units import UM, Array, to_mm
from planner.design.assumptions import HIGHEST_GEAR_WAVE, POSES_OF_AN_OPEN_PLAN, UNMEASURED_TOOL_PRIOR
from planner.design.expected_errors import EVERYWHERE
from planner.design.observability.identifiability import DroppedParameter, Identifiability, explain_direction
from planner.design.observability.information import predict_covariance
from planner.effects.catalogue import Excitation, catalogue
from planner.effects.compliance import JOINT_COMPLIANCE, compliance_parameters
from planner.effects.effect import Effect, Parameter, Place, joint_place
from planner.effects.nonparametric import gear_curve
from planner.effects.sizes import GEAR_CURVE_SIZE, UNKNOWN_PRIOR
from planner.effects.usual_errors import TYPICAL_FACTOR, is_usual, usual_errors
from planner.kinematics.robot import Robot
from planner.model.model import Model
from planner.model.tool_error import ToolError, uniform_states
from planner.runs.run import Samples

PROBE_POSES = 2000  # of a pool, evenly spread, are enough to tell which effects show


def planned_model(cell: Cell, samples: Samples) -> Model:
    """Return the model of everything that the cell's ``[plan]`` frees, seen from the poses ``samples``.

    Raises:
        InputError: an effect that the catalogue does not have, or that these poses do not show.
    """
    model = Model.from_cell(cell)
    rows = np.unique(np.linspace(0, len(samples) - 1, min(PROBE_POSES, len(samples))).astype(int))
    return model.plus(declared_parameters(cell, model.setup, samples.take(rows)))


def declared_parameters(
    cell: Cell, setup: MeasurementSetup, samples: Samples, more: tuple[str, ...] = ()
) -> list[Parameter]:
    """Return the parameters of the effects in the cell's ``[plan]``, each kind a group, as far as the samples show any.

    Those of the kinds in ``more`` follow; the samples need not show any of these.

    Raises:
        InputError: ``[plan]`` has a kind that the catalogue does not have, or that these samples do not show.
    """
    kinds = tuple(dict.fromkeys((*cell.plan.effects, *more)))
    if not kinds:
        return []
    entries = [e for e in catalogue(setup, samples) if e.nonlinear is None]
    known = {e.kind for e in entries}
    for wanted in cell.plan.effects:
        if wanted not in known:
            raise InputError(
                f"{cell.path}: plan.effects names '{wanted}'{did_you_mean(wanted, sorted(known))}; these poses can show"
                f" {', '.join(sorted(known))}"
            )
    return [replace(p, group=kind) for kind in kinds for e in entries if e.kind == kind for p in e.make(None)]


def check_effects(cell: Cell) -> None:
    """Refuse effects in ``[plan]`` that no poses of the cell's robot would show, before a minute's work.

    Raises:
        InputError: as :func:`declared_parameters`.
    """
    setup = setup_of(cell)
    # 50: any states: it is only asked whether each effect has a name
    _ = declared_parameters(cell, setup, Samples.at(uniform_states(cell, 50, 0)))


def preference_order(model: Model, frame_stated: bool = True) -> list[int]:
    """Return positions of the parameters, best kept first.

    A bar's as they stand. Where a frame takes up how the arm's first rows stand, the rows nearest to the tool are
    kept: the frame's own parameters, then the robot's from the tool inwards, the last joint's angle and effects last.
    Of a robot from a URDF, whose frames have six errors each, joint zeros come first and lengths before angles: the
    user can set the zeros in the controller. Of a frame that the cell does not state (``frame_stated``) nobody can have
    planned, and all stay as they stand.
    """
    order = range(len(model.parameters))
    from_urdf, framed = model.setup.robot.convention == "urdf", model.setup.has_own_frames
    if not (frame_stated if framed else from_urdf):
        return list(order)
    kinds, zeros = [p.group for p in model.parameters], model.setup.robot.zero_names
    last = [k for k in order if model.parameters[k].name == zeros[-1]]
    rows = [k for k in order if kinds[k] == "geometry" and k not in last]
    if framed:
        rows.reverse()
    if from_urdf:
        rows.sort(key=lambda k: (model.names[k] not in zeros, model.parameters[k].unit != "m"))
    return [
        *(k for k in order if kinds[k] == "gauge"),
        *rows,
        *last,
        *(k for k in order if kinds[k] not in ("gauge", "geometry")),
    ]


def hold_measured_tool(
    cell: Cell, model: Model, rows: Array, noise: float, poses: int | None = None
) -> tuple[DroppedParameter, ...]:
    """Return the tool's parameters that were measured to less than the noise of one reading.

    They are kept fixed. If they were free, they would take up errors of other parameters: an error of the tool point
    that is smaller than the noise does not show in a reading, and does no harm. Beside each parameter stands how
    well the readings alone would determine it.

    Args:
        cell: the cell; without ``tool.map_sigma_um`` nothing is held.
        model: all that is freed.
        rows: its rows over candidates, or over what was measured, (n, r, P).
        noise: of one reading [m].
        poses: how many were measured; ``None`` for a plan, which says how many will be.
    """
    if not cell.tool.measured:
        return ()
    part = rows[:: max(1, len(rows) // PROBE_POSES)]
    per_reading = noise * np.sqrt(len(part) / (poses or cell.plan.poses or POSES_OF_AN_OPEN_PLAN))
    whose = "planned" if poses is None else "run's"
    moves = np.sqrt((part**2).sum(axis=1).mean(axis=0))
    out = []
    for k, p in enumerate(model.parameters):
        if not p.name.startswith("map_") or p.prior * moves[k] > noise:
            continue
        prior = model.prior.copy()
        prior[k] = UNMEASURED_TOOL_PRIOR
        std = float(predict_covariance(part, per_reading, prior).std[k])
        told = f"{float(f'{std / UM:.2g}'):g} µm"
        why = (
            f"{p.name} was measured on the tool to {p.prior / UM:.2g} µm (tool.map_sigma_um), less than the noise of "
            f"one reading, {noise / UM:.2g} µm; the {whose} readings alone would tell it to {told}: held"
        )
        out.append(DroppedParameter(p.name, why, ((p.name, 1.0),)))
    return tuple(out)


def unloaded_compliances(kinds: tuple[str, ...], model: Model) -> tuple[DroppedParameter, ...]:
    """Return the joint compliances that are asked for and no pose can show, as no weight turns the joint."""
    if JOINT_COMPLIANCE not in kinds:
        return ()
    missing = [p for p in compliance_parameters(model.setup) if p.name not in model.names]
    return tuple(DroppedParameter(p.name, explain_direction(d := ((p.name, 1.0),)), d) for p in missing)


def add_dropped_parameters(
    seen: Identifiability, names: tuple[str, ...], others: tuple[DroppedParameter, ...]
) -> Identifiability:
    """Return what is seen, its positions counted in all of ``names``, and beside it what else was left out."""
    kept = tuple(names.index(name) for name in seen.names)
    return replace(seen, kept=kept, dropped=(*seen.dropped, *others))


ASSUMED = (
    f"every gear errs by {GEAR_CURVE_SIZE.usual * 1e6:.0f} µrad, repeating up to {HIGHEST_GEAR_WAVE:.0f} times a turn, "
    "every joint gives way. Joints have lost motion, and the base turns with the arm's place"
)


@dataclass(frozen=True)
class UndeclaredErrors:
    """The model of everything that may have to be found, and what it does to the tool.

    Attributes:
        model: with the geometry that is freed, and the effects that nobody declared.
        prior: one-sigma sizes, (P,), finite.
        weight: mean square error of the tool per squared errors, (P, P).
        untraced_error: error of the tool [m] that the gears' errors leave where all else is fitted as well as can be.
    """

    model: Model
    prior: Array
    weight: Array
    untraced_error: float

    where: ClassVar[str] = EVERYWHERE
    untraced_label: ClassVar[str] = "geometry alone"
    doubt: ClassVar[float] = 0.0  # sizes count as known
    assumptions: ClassVar[str] = ASSUMED
    before_label: ClassVar[str] = "as such a robot comes"
    condition: ClassVar[str] = (
        f". Expected where gears err by {GEAR_CURVE_SIZE.usual * 1e6:.0f} µrad, in up to {HIGHEST_GEAR_WAVE:.0f} "
        "periods a turn, joints yield and have lost motion, and the base turns"
    )

    @property
    def root(self) -> Array:
        """Root of the prior covariance, (P, P): each error is one parameter."""
        return np.diag(self.prior)

    @property
    def of_gauge(self) -> np.ndarray:
        """Which errors only say where the gauge stands, (P,) bool."""
        return np.array([p.group == "gauge" for p in self.model.parameters])

    @property
    def usual(self) -> np.ndarray:
        """Family of those of which most robots have little and few much, (P,) int; −1 of all others."""
        # errors with a name are the model's first parameters, in their order
        groups = [p.group for p in self.model.parameters[: len(self.of_gauge)]]
        families = list(dict.fromkeys(filter(is_usual, groups)))
        return np.array([families.index(g) if g in families else -1 for g in groups])

    def state(self, square: float) -> float:
        """Return the error of the tool [m], rms over robots and workspace, of a mean square [m²]."""
        return float(np.sqrt(max(square, 0.0)))

    def state_limit(self, square: float) -> float:
        """Return the error [m] that 95 of 100 robots stay below, from that quantile of its square [m²]."""
        return self.state(square)

    def describe(self, left: float, left_mm: str, at_most_mm: str) -> str:
        """Say what the session would leave [m], written and as a limit [mm]; the last sentence has no stop."""
        few = " These are too few poses for more than the geometry." if left > self.untraced_error else ""
        return (
            f"the tool keeps an error of {left_mm} mm, rms over the workspace. It is below {at_most_mm} mm, "
            f"95 % sure.{few} A fit of the geometry alone leaves {float(to_mm(self.untraced_error)):.3f} mm"
        )

    @property
    def weight_per_prior(self) -> Array:
        """The weight for errors in prior sigmas, (P, P) [m²]."""
        return np.asarray(self.weight * np.outer(self.prior, self.prior))

    def on(self, model: Model) -> Self:
        """Return the same errors in another model of the same parameters."""
        return replace(self, model=model)

    def white(self, samples: Samples) -> Array:
        """Return the rows of readings in standard deviations per prior sigma, (n r, P)."""
        return self.model.reading_noise(samples).white(self.model.rows(samples) * self.prior)


def gear_factor(robot: Robot, joint: int) -> float:
    """Return the ratio of a gear's whole error to the usual one, as a fleet has shown it; ``joint`` counts from 0."""
    kinds = ("gear once a turn", "gear twice a turn", "gear harmonics", "gear ripple")
    return float(np.sqrt(np.mean([robot.priors.factor(f"{kind}, joint {joint + 1}") ** 2 for kind in kinds])))


def _expected_gears(cell: Cell, setup: MeasurementSetup) -> list[Effect]:
    """Return the error of every gear, one effect a joint."""
    ends, gears = np.array(cell.joint_range), []
    for j in range(cell.robot.n_joints):
        gear, factor = gear_curve(setup, ends, j, HIGHEST_GEAR_WAVE), gear_factor(cell.robot, j)
        gears.append(replace(gear, parameters=tuple(p.with_prior(p.prior * factor) for p in gear.make(None))))
    return gears


def _expected_usual(cell: Cell, setup: MeasurementSetup, samples: Samples) -> list[Effect]:
    """Return lost motion, loads that no pose shows and turns of the base, one effect a family."""
    out = []
    for name, own in usual_errors(Excitation.of(setup, samples), planned=True):
        kind, _, joint = name.partition(", joint ")
        place = joint_place(int(joint) - 1) if joint else Place("base")
        size = TYPICAL_FACTOR * cell.robot.priors.factor(name)
        parameters = tuple(replace(p, prior=p.prior * size, group=name) for p in own)
        out.append(Effect(kind, place, parameters, "", np.inf, "sizes that plans expect of every robot"))
    return out


def expected_effects(cell: Cell, setup: MeasurementSetup, samples: Samples) -> tuple[Effect, ...]:
    """Return what plans expect of every robot beside geometry and compliance: of their forecasts and of drawn robots.

    The prior of each parameter is its one-sigma size.
    """
    return (*_expected_gears(cell, setup), *_expected_usual(cell, setup, samples))


def undeclared_errors(cell: Cell, samples: Samples) -> UndeclaredErrors:
    """Return the errors that a cell may have and has not declared, as the poses ``samples`` show them.

    Raises:
        InputError: the cell declares an effect that these poses do not show.
    """
    base = planned_model(cell, samples)
    gears = [p for gear in _expected_gears(cell, base.setup) for p in gear.make()]
    declared = set(base.names)
    soft = compliance_parameters(base.setup) if base.setup.weighs else []
    usual = [p for family in _expected_usual(cell, base.setup, samples) for p in family.make()]
    model = base.plus([*gears, *(p for p in soft if p.name not in declared), *usual])
    prior = np.where(np.isfinite(model.prior), model.prior, UNKNOWN_PRIOR)
    effects = [p for p in model.parameters if p.is_effect]
    weight = ToolError.of(cell, effects).weight(model.names)
    return UndeclaredErrors(model, prior, weight, _untraced_error(weight, prior, [p.name for p in gears], model))


def _untraced_error(weight: Array, prior: Array, hidden: list[str], model: Model) -> float:
    """Square of the hidden effects' prior sigmas through what is left of the weight when all else fits them best."""
    unseen = [k for k, name in enumerate(model.names) if name in set(hidden)]
    fitted = [k for k in range(len(prior)) if k not in set(unseen)]
    W = weight * np.outer(prior, prior)
    uu, uf, ff = (W[np.ix_(a, b)] for a, b in ((unseen, unseen), (unseen, fitted), (fitted, fitted)))
    left = np.trace(uu) - np.trace(uf @ np.linalg.pinv(ff, rcond=1e-10, hermitian=True) @ uf.T)
    return float(np.sqrt(max(left, 0.0)))
