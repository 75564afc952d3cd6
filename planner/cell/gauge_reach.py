"""Where a gauge can read: its range and cones, how it samples joint states, its bodies, how fast it follows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.cell.gauge_types import FilterStage, GaugeBody, JointSamples, PointTravel
from planner.cell.parts import Fixture
from planner.cell.site import Site
from planner.common.sequences import sobol_points
from planner.common.units import Array
from planner.runs.run import Mounting


@dataclass(frozen=True, kw_only=True)
class GaugeReach:
    """The workspace of a gauge, for candidates, paths and collisions.

    Attributes:
        length_min, length_max: range of the reading [m].
        cone_fixture, cone_map: largest tilt at the place and at the tool point [rad].
        trim: what is left free of bodies before the tool point [m].
        radius: of what stands at the place [m].
        rate, acceleration: largest change of the reading that it follows while it is attached [m/s, m/s²].
        stop_margin: what a plan keeps from either end of the range [m].
    """

    length_min: float = 0.0
    length_max: float = np.inf
    cone_fixture: float = np.pi
    cone_map: float = np.pi
    trim: float = 0.0
    radius: float = 0.0
    rate: float = np.inf
    acceleration: float = np.inf
    stop_margin: float = 0.0

    left_to_person: float = 0.0  # share of the last way to a ball that a person goes, not the program
    is_attached: ClassVar[bool] = False  # whether it is held between a fixture and the tool while it reads
    is_loaded: ClassVar[bool] = False  # whether it pulls
    can_be_loaded: ClassVar[bool] = False  # whether loaded circles can be measured with its kind

    @property
    def planned_range(self) -> tuple[float, float]:
        """Return the shortest and the longest length that a plan uses: the range less the margin at its ends [m]."""
        return self.length_min + self.stop_margin, self.length_max - self.stop_margin

    @property
    def unchecked_length(self) -> float:
        """Return how much of what it holds between fixture and tool no body stands for, at most [m]."""
        return 0.0

    def joint_sampler(self, cell: Site, mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Return a function that draws a number of joint states; later draws fill the gaps of earlier ones."""
        lower, upper = cell.sampling_range
        draw = sobol_points(len(lower), seed)
        return lambda count: JointSamples(lower + draw(count) * (upper - lower), count)

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Filter and name of each margin of :meth:`margins`, filter by filter."""
        return ()

    def margins(self, stage: FilterStage, place: Fixture, p_BM: Array, axis_B: Array) -> Array:
        """Margins of one filter at tool points (n, 3) [m] with axes (n, 3), (n, c) [m or rad]; negative outside."""
        return np.empty((len(p_BM), 0))

    def margin_changes(self, travel: PointTravel) -> list[Array]:
        """Bounds on the change of each margin over neighbourhoods, (m,) each [m or rad]."""
        return []

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """Return the bodies that it brings."""
        return []

    def reach_surfaces(self, cell: Site) -> tuple[tuple[Array, Array, float, float], ...]:
        """Return the surfaces between which it reads: centre (3,) [m], axis (3,), radius [m], opening angle [rad]."""
        return ()

    def fits(self, cell: Site, q: Array, ball: int) -> np.ndarray:
        """Tell at which poses q (n, N) [rad] the tool is turned as a ball allows, (n,) bool."""
        return np.ones(len(q), dtype=bool)

    def retract(self, cell: Site, q: Array, ball: int) -> tuple[Array, Array]:
        """Return where the tool comes from to poses q (n, N) [rad] at a ball, and by how much that misses, (n,) [m]."""
        return q, np.zeros(len(q))

    def tool_speed(self, cell: Site) -> float:
        """Return the limit of the tool point's speed while it is attached or read [m/s]."""
        return cell.motion.tool_speed if cell.motion.is_continuous else np.inf

    def leg_speeds(self, cell: Site, visit: np.ndarray) -> float | Array:
        """Return the speed limits on the legs of a path with visits (m,): one for all, or (m − 1,) [m/s]."""
        return self.tool_speed(cell)
