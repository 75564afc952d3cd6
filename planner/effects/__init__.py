"""Effects: pairs of an elementary transform and a basis function φ of the sample."""

from planner.effects.basis import ONE, AtPlace, AtPoint, LoadTorque, One, Phi
from planner.effects.context import Context
from planner.effects.gravity import gravity_torque

__all__ = ["ONE", "AtPlace", "AtPoint", "Context", "LoadTorque", "One", "Phi", "gravity_torque"]
