"""Candidate poses: states in the gauge's workspace that pass every filter, each filter counted."""

from planner.candidates.balls import draw_at_balls
from planner.candidates.contact import FirstContact
from planner.candidates.pool import BeamFunnel, Funnel, PoseSet, draw_candidates

__all__ = ["BeamFunnel", "FirstContact", "Funnel", "PoseSet", "draw_at_balls", "draw_candidates"]
