"""The shortest order in which to visit the poses, proven."""

from planner.tour.cost import slowest_axis_cost
from planner.tour.solve import Method, Tour, solve_tour

__all__ = ["Method", "Tour", "slowest_axis_cost", "solve_tour"]
