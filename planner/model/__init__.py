"""Predicted reading and identification Jacobian: one list of parameters for planning, fitting and tracing."""

from planner.model.model import Model
from planner.model.parameters import Move, Parameter

__all__ = ["Model", "Move", "Parameter"]
