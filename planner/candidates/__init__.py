"""Candidate poses: states in the gauge's spherical shell that pass every filter, each filter counted."""

from planner.candidates.pool import Funnel, PoseSet, draw_candidates

__all__ = ["Funnel", "PoseSet", "draw_candidates"]
