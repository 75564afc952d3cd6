"""The cell: robot, tool, fixtures and surroundings, with the gauge that measures there."""

from dataclasses import dataclass, field, replace
from typing import Self

from planner.cell.gauge import Gauge
from planner.cell.site import Site
from planner.common.errors import InputError


@dataclass(frozen=True, repr=False)
class Cell(Site):
    """A site with its gauge.

    Attributes:
        gauge: what is read, and its noise.

    Example:
        >>> cell = load_cell("comau-nj130/edbb")  # doctest: +SKIP
        >>> cell.home + 0.1  # (N,) rad  # doctest: +SKIP
    """

    gauge: Gauge = field(kw_only=True)

    def __repr__(self) -> str:
        """Name the cell, its robot and its gauge."""
        return f"Cell('{self.path}', robot='{self.robot.name}', gauge='{self.gauge.kind}')"

    @property
    def rest_seconds(self) -> float:
        """Return the time for which the robot rests at a pose [s]."""
        motion, gauge = self.motion, self.gauge
        if motion.is_continuous:
            return gauge.reading_seconds
        return motion.settle + gauge.reading_seconds + (0.0 if gauge.drives_on_when_read else motion.dwell)

    @property
    def seconds_until_read(self) -> float:
        """Return the time from where the robot has come to rest at a pose to the middle of the reading [s]."""
        return (self.motion.settle + self.rest_seconds) / 2

    def with_reading_time(self) -> Self:
        """Return the cell whose file states the time for which the robot waits for a reading, if it waits.

        A plan states what it has reckoned with; files of plans from before have no such time.
        """
        gauge, file = self.gauge, self.file.gauge
        usual = gauge.usual_reading_times.get(gauge.read_by)
        if usual is None or file.reading_s is not None:
            return self
        stated = file.model_copy(update={"read_by": gauge.read_by, "reading_s": usual})
        return replace(
            self,
            file=self.file.model_copy(update={"gauge": stated}),
            gauge=replace(gauge, reading_time=usual),
        )

    @property
    def is_under_load(self) -> bool:
        """Whether a bar pulls at the tool, or something else than poses is driven."""
        return self.gauge.is_loaded or bool(self._driven_tables)

    @property
    def _driven_tables(self) -> tuple[str, ...]:
        """The sections of which a session is planned, and not one of poses."""
        return tuple(key for key, content in self.sections.items() if content.replaces_poses)

    def has_bar(self, free: bool = False) -> bool:
        """Tell whether a bar is attached between fixture and tool; ``free``: without load, at poses."""
        return self.gauge.is_attached and not (free and self.is_under_load)

    def require_bar(self, use: str, free: bool = False) -> None:
        """Refuse a gauge that is not attached between fixture and tool.

        Args:
            use: what needs one, the beginning of a sentence.
            free: whether a loaded bar, and a cell of which no poses are planned, are refused as well.

        Raises:
            InputError: naming the gauge's kind.
        """
        if not self.has_bar(free):
            tables = "".join(f" with [[{key}]]" for key in self._driven_tables)
            raise InputError(f"{self.path}: {use}, and gauge.kind is '{self.gauge.kind}'{tables}")
