"""What a session works with, and where it stands."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from planner.centring.course import Visit, Way
from planner.centring.indicators import Indicators
from planner.centring.journal import Journal
from planner.centring.link import RobotLink
from planner.centring.settings import Settings
from planner.centring.stopping import Stop

Say = Callable[[str], None]


@dataclass
class Place:
    """Where the robot is, in words, for a person who reads why it stopped."""

    text: str = "at the start"


@dataclass(frozen=True)
class Bench:
    """Indicators, robot, limits, the stop that all look at, and who is told."""

    indicators: Indicators
    link: RobotLink
    settings: Settings
    stop: Stop
    say: Say
    place: Place = field(default_factory=Place)


@dataclass(frozen=True)
class Session:
    """A plan, and what is measured of it so far."""

    way: Way
    journal: Journal

    @property
    def pending(self) -> list[Visit]:
        """The poses that are left, in the order driven."""
        return [v for v in self.way.visits if v.id not in self.journal.measured]

    @property
    def output(self) -> Path:
        """The run."""
        return self.journal.output
