"""The shortest order in which to visit the poses, proven."""

from planner.tour.cost import slowest_axis_cost
from planner.tour.solve import Method, Tour, demand_concorde, solve_tour

__all__ = ["Method", "Tour", "demand_concorde", "slowest_axis_cost", "solve_tour"]
