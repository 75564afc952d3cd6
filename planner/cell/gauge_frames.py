"""How a gauge stands, as far as it is known, and what of that is found from a run."""

from abc import ABC, abstractmethod
from typing import ClassVar

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_types import LeftStanding
from planner.cell.placement import P, Placement
from planner.cell.site import Site
from planner.common.units import Array
from planner.runs.run import Run


class GaugeFrames(ABC):
    """Places and frames of a gauge: as a run numbers them, found from it, and kept from session to session."""

    frees_base: ClassVar[bool] = False  # whether its frame is free, so that it takes up how the robot's base stands
    set_anew: ClassVar[str] = "zero"  # how the names of its parameters begin that are others in every session

    def declared_frame(self, file: CellFile) -> PlacedFile | None:
        """Return the section of the cell file that says where its frame stands; ``None``: it has no frame."""
        return None

    @abstractmethod
    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with its places as the run numbers them.

        Raises:
            InputError: the run names one that the cell does not have.
        """

    @abstractmethod
    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Return the setup with what is not known found from the run; ``p_FM`` (T, 3) [m] where the cell has it.

        Raises:
            InputError, NoSolutionError: the run cannot tell where the gauge stands.
        """

    def lasting_places(self, setup: Placement) -> dict[str, Array] | None:
        """Return places (3,) [m] that stand from session to session by their names; ``None``: not known where."""
        return {}

    def kept_mounting(self, setup: Placement) -> LeftStanding:
        """Return the parts that a later run finds as the last run left them; none if the gauge is set up each time."""
        return LeftStanding()

    def place_nominally(self, setup: P, cell: Site) -> P:
        """Return the setup with its frame where the cell states it, where readings of a run to come depend on that."""
        return setup

    def set_up_again(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup for the run of a later session, with what was set up anew found from it (or errors)."""
        return setup

    def needs_new_frames(self, setup: Placement, run: Run) -> bool:
        """Tell whether the run stands in frames that the setup does not know."""
        return False
