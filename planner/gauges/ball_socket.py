"""A ball on the tool that is set into one of several sockets of a plate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from planner.cell.file import CellFile
from planner.cell.gauge_registry import register_gauge
from planner.gauges.balls import BallGauge
from planner.gauges.trical import read_head


@register_gauge
@dataclass(frozen=True)
class BallSocket(BallGauge):
    """Sockets at known places in a plate's own frame; no session is planned for it."""

    kind: ClassVar[str] = "ball-socket"
    default_noise_um: ClassVar[float] = 100.0
    plannable: ClassVar[bool] = False

    @classmethod
    def read_own(cls, path: Path, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the head of indicators, if it has one."""
        return {"head": read_head(path, file)}
