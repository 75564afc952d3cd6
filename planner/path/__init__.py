"""Support poses and the continuously verified path of a tour.

Every constraint is a margin with a bound on how fast it can change; a motion is proven when adaptive bisection
covers it with neighbourhoods in which no margin can be used up. Detours are found by OMPL.
"""

from planner.path.constraints import Constraints
from planner.path.joining import join
from planner.path.proof import Proof
from planner.path.result import Gaps, Leg, Path, Verdict
from planner.path.roadmap import parts
from planner.path.verdict import Apart, judge

__all__ = ["Apart", "Constraints", "Gaps", "Leg", "Path", "Proof", "Verdict", "join", "judge", "parts"]
