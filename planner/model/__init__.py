"""Predicted reading and identification Jacobian: one list of parameters for planning, fitting and tracing."""

from planner.model.model import Linear, Model
from planner.model.parameters import Move, Parameter

__all__ = ["Linear", "Model", "Move", "Parameter"]
