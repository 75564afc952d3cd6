"""``fleet()``: how large the errors of a kind of robot are, from several of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from planner.cell.fleet_file import FleetSize
from planner.common.console import as_word
from planner.common.content_hashes import HandEdit
from planner.common.files import write_text
from planner.common.result import Result
from planner.common.summary import Summary
from planner.workflow.fleet_robots import Fleet, read_robots


@dataclass(frozen=True, repr=False)
class FleetResult(Result):
    """The sizes of a fleet's errors; ``write`` takes the path of ``fleet.toml``.

    Attributes:
        fleet: size of each error of this kind of robot [m or rad], with its uncertainty.

    Example:
        >>> fleet(["calibrated", "other"]).write("fleet.toml")  # doctest: +SKIP
    """

    fleet: Fleet

    def overview(self) -> Summary:
        """Return the overview: errors larger or smaller than usual, and robots that do not fit."""
        sizes = sorted(self.fleet.file().sizes, key=lambda s: -_times_off(s))
        # 1.5: times larger or smaller than usual, from where the screen says a size
        notable = [s for s in sizes if _times_off(s) >= 1.5]
        facts = [("" if k else "not as usual", _words(s)) for k, s in enumerate(notable[:8])]
        odd = self.fleet.misfits()
        facts += [("" if k else "odd", m.sentence) for k, m in enumerate(odd)]
        if odd:
            names = ", ".join(dict.fromkeys(m.name for m in odd))
            facts.append(
                ("", f"the sizes count {names} too; if it was damaged, or is built otherwise, give the others alone")
            )
        details = [("" if k else "sizes", _words(s)) for k, s in enumerate(self.fleet.file().sizes)]
        title = f"{len(self.fleet.robots)} robots {self.fleet.robot}: {len(sizes)} sizes of errors"
        return Summary(title, facts or [("sizes", "all about as usual")], details)

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robots that it is made of."""
        return self.fleet.hand_edits

    def content(self) -> Mapping[str, Any]:
        """Return what ``fleet.toml`` says."""
        return self.fleet.file().model_dump(mode="json", by_alias=True)

    def text(self) -> str:
        """Return the text of ``fleet.toml``."""
        remarks = "".join(f"# {edit.remark}\n" for edit in self.fleet.hand_edits)
        return remarks + tomli_w.dumps(dict(self.content()))

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write ``fleet.toml``; return its path."""
        path = Path(folder)
        write_text(path, self.text(), force=force)
        return [path]

    def next_step(self, folder: Path) -> str:
        """Say what it is for."""
        return (
            f"edbb plan CELL --fleet {as_word(folder)} -o next plans for such a robot; "
            f"edbb identify RUN.csv --cell CELL --fleet {as_word(folder)} -o calibrated identifies it"
        )


def _times_off(size: FleetSize) -> float:
    """How far from usual a size is, as a factor either way."""
    return max(size.factor, 1 / size.factor)


def _words(size: FleetSize) -> str:
    low, high = (size.factor * times for times in (1 / (1 + size.log_std), 1 + size.log_std))
    return f"{size.group}: {size.factor:.2f} times the usual ({low:.2f} to {high:.2f}), by {size.seen:.0f} errors seen"


def fleet(records: Sequence[Path | str]) -> FleetResult:
    """Estimate how large the errors of a kind of robot are, joint by joint, with their uncertainty.

    Args:
        records: of two robots or more, their records, or folders that ``identify`` has written.

    Raises:
        InputError: one robot alone, robots of several kinds, or a folder that is neither.

    Example:
        >>> fleet(["calibrated", "other"]).write("fleet.toml")  # doctest: +SKIP
    """
    return FleetResult(read_robots([Path(r) for r in records]))
