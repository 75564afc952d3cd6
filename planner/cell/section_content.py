"""What an extension has read of a section of a cell file, as far as the cell itself asks."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class SectionContent:
    """Base of what was read of a section that an extension declares.

    ``replaces_poses``: whether a session is planned of it, and not one of measuring poses.
    """

    replaces_poses: ClassVar[bool] = False

    @property
    def pulls(self) -> Mapping[int, str]:
        """The fixtures at which the gauge pulls at the tool, each with the key of the file that says so."""
        return {}
