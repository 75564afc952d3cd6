"""The solver that is always there: local search for a tour, branch and cut for the proof."""

from planner.tour.branch import BranchAndCut, Outcome
from planner.tour.instance import Instance
from planner.tour.local_search import LocalSearch, greedy_tour, nearest_neighbours

_NEIGHBOURS = 8
_WORK = 200_000  # nodes of the search tree times nodes of the tour: 1000 at 200 poses, where a dozen is usual
_LEAST_NODES = 50


def first_search(instance: Instance, seed: int) -> LocalSearch:
    """Return a local search that has come to a good tour, a few per cent at most above the best."""
    weight = instance.weighted()
    search = LocalSearch(weight, nearest_neighbours(weight, _NEIGHBOURS), greedy_tour(weight), seed)
    search.improve(len(weight) // 2)
    return search


def solve_embedded(instance: Instance, search: LocalSearch, nodes: int | None = None) -> Outcome:
    """Return the best tour found from ``search`` on, and the lower bound proven for it over ``nodes`` of the tree."""
    size = len(instance.cost)
    limit = max(_LEAST_NODES, _WORK // size) if nodes is None else nodes
    return BranchAndCut(instance, search).run(kicks=2 * size, nodes=limit)
