"""Where an arm comes to stand when its joints yield under its weights, its payload and the pull of a loaded bar."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.units import Array, read_only
from planner.effects.compliance import DriveTorque, LoadTorque
from planner.effects.context import Context
from planner.effects.effect import Parameter
from planner.kinematics.geometry import bar_state
from planner.model.model import Model
from planner.runs.run import Samples

BALANCE_ROUNDS = 3  # each is a hundred times nearer: a deflection of 1 mm turns a bar of 130 mm by 8 mrad


def use_held_torques(parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Return the parameters with compliances driven by the torques of the samples; see :func:`with_held_torque`."""

    def hold(p: Parameter) -> Parameter:
        """Return the parameter with the held torque in the place of the load's."""
        phi = p.main_move.phi
        return (
            replace(p, moves=(replace(p.main_move, phi=DriveTorque(phi.joint)),)) if isinstance(phi, LoadTorque) else p
        )

    return tuple(hold(p) for p in parameters)


def solve_equilibrium(model: Model, samples: Samples, errors: Array) -> tuple[Model, Samples]:
    """Return model and samples such that arm, weights and bar are in balance at the errors (P,), by held torques."""
    held = replace(model, parameters=use_held_torques(model.parameters))
    samples = with_held_torque(samples, model, np.zeros(len(errors)))
    for _ in range(BALANCE_ROUNDS):
        samples = with_held_torque(samples, held, errors)
    return held, samples


def with_held_torque(samples: Samples, model: Model, errors: Array) -> Samples:
    """Return samples with the torques of weights and bar at the true place of arm and fixture by the errors (P,).

    A bar of 130 mm turns by a percent where its ball is a millimetre off or the arm yields as much, and its moments
    with it. Weights bend the arm by milliradians. The torques stand as if logged, as those that the drives hold.
    """
    setup, context = model.setup, Context(model.setup, samples)
    delta = setup.offsets(samples)
    for p, value in zip(model.parameters, errors, strict=True):
        for m in p.moves if value else ():
            if m.on == "transform":
                delta[m.index] = delta[m.index] + value * context.value(m.phi)
    turned = np.stack([np.broadcast_to(delta[k], len(samples)) for k in context.joints], axis=1)
    q = samples.q + turned @ np.linalg.inv(setup.robot.coupling_matrix).T
    torque = Context(setup, replace(samples, q=q, force=None)).load_torque
    if samples.force is not None:
        motion = setup.chain.forward(context.theta, delta)
        pull = -samples.force * bar_state(motion.x.T, setup.p_BX[samples.place]).direction.T
        torque = torque + np.einsum("jkn,kn->nj", motion.point_screws(context.joints), pull)
    held = -torque * np.sign(np.diag(setup.robot.coupling_matrix))
    return replace(samples, torque=read_only(held))
