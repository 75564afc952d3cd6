"""The arm in balance with its loads: where it comes to stand when its joints yield."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.common.units import Array, read_only
from planner.effects.compliance import DriveTorque, LoadTorque
from planner.effects.context import Context
from planner.effects.effect import Parameter
from planner.instruments.loaded.circle import measured_points
from planner.instruments.loaded.types import AveragedCurves
from planner.kinematics.geometry import bar_state
from planner.model.model import Model
from planner.runs.run import Samples

ROUNDS = 3  # each is a hundred times nearer: a deflection of 1 mm turns a bar of 130 mm by 8 mrad


def deflect_joints(setup: MeasurementSetup, samples: Samples, value: Array) -> Samples:
    """Return the samples with the angles to which the joints yield under weight, payload and the bar's pull.

    The torques are those at the place where the arm comes to stand, not where it was sent: the bar's direction
    follows the deflection, by up to a percent, and the weights' levers a little.

    Args:
        setup: with the fixture where it is.
        samples: as driven.
        value: compliance of every joint, (N,) [rad/Nm].
    """
    back = np.linalg.inv(setup.robot.sense_matrix)
    q = samples.q
    for _ in range(ROUNDS):
        torque = Context(setup, replace(samples, q=q)).load_torque
        q = samples.q + (torque * value) @ back.T
    return replace(samples, q=read_only(q))


def use_held_torques(parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Return parameters with compliances by the torques that the samples carry, see :func:`with_held_torque`."""

    def hold(p: Parameter) -> Parameter:
        phi = p.main.phi
        return replace(p, moves=(replace(p.main, phi=DriveTorque(phi.joint)),)) if isinstance(phi, LoadTorque) else p

    return tuple(hold(p) for p in parameters)


def solve_equilibrium(model: Model, samples: Samples, errors: Array) -> tuple[Model, Samples]:
    """Return model and samples such that arm, weights and bar are in balance at the errors (P,), by held torques."""
    held = replace(model, parameters=use_held_torques(model.parameters))
    samples = with_held_torque(samples, model, np.zeros(len(errors)))
    for _ in range(ROUNDS):
        samples = with_held_torque(samples, held, errors)
    return held, samples


def with_held_torque(samples: Samples, model: Model, errors: Array) -> Samples:
    """Return samples with the torques of weights and bar where the errors (P,) say that arm and fixture really are.

    A bar of 130 mm turns by a percent where its ball is a millimetre off or the arm yields as much, and its moments
    with it; weights bend the arm by milliradians. The torques stand as if logged, as those that the drives hold.
    """
    setup, context = model.setup, Context(model.setup, samples)
    delta = setup.offsets(samples)
    for p, value in zip(model.parameters, errors, strict=True):
        for m in p.moves if value else ():
            if m.on == "transform":
                delta[m.index] = delta[m.index] + value * context.value(m.phi)
    turned = np.stack([np.broadcast_to(delta[k], len(samples)) for k in context.joints], axis=1)
    q = samples.q + turned @ np.linalg.inv(setup.robot.sense_matrix).T
    torque = Context(setup, replace(samples, q=q, force=None)).load_torque
    if samples.force is not None:
        motion = setup.chain.forward(context.theta, delta)
        pull = -samples.force * bar_state(motion.x.T, setup.p_BX[samples.place]).direction.T
        torque = torque + np.einsum("jkn,kn->nj", motion.point_screws(context.joints), pull)
    held = -torque * np.sign(np.diag(setup.robot.sense_matrix))
    return replace(samples, torque=read_only(held))


def lower_fixture(setup: MeasurementSetup, curves: AveragedCurves, value: Array) -> MeasurementSetup:
    """Return the setup with a circle's fixture as much lower as the weights alone bend the arm.

    Where the fixture stands is known from the arm itself, which sags as much when it is driven there.
    """
    p_BX, samples = np.array(setup.p_BX), samples_of(curves, loaded=False)
    sagged = deflect_joints(setup, samples, value)
    p_BX[curves.circle.place] += (measured_points(setup, sagged.q) - measured_points(setup, samples.q)).mean(axis=0)
    return replace(setup, p_BX=read_only(p_BX))


def raise_fixture(setup: MeasurementSetup, curves: AveragedCurves, height: float) -> MeasurementSetup:
    """Return the setup with the fixture of a circle higher along the circle's normal [m]."""
    p_BX = np.array(setup.p_BX)
    p_BX[curves.circle.place] += height * curves.circle.axes[2]
    return replace(setup, p_BX=read_only(p_BX))


def samples_of(curves: AveragedCurves, loaded: bool = True) -> Samples:
    """Every angle, load and sense of a circle as a sample, with the bar's pull or without."""
    n = curves.length.size
    force = curves.force.ravel() if loaded else np.zeros(n)
    return Samples(q=read_only(curves.q.reshape(n, -1)), place=np.full(n, curves.circle.place), force=read_only(force))
