"""``record()``: the history of one physical robot, added to and shown."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from planner.checks.record import Circumstances, RobotRecord, Withdrawal, map_to_opcua
from planner.checks.record_changes import add_entry, withdraw_entry
from planner.common.console import as_word
from planner.common.errors import InputError
from planner.common.files import document_text, write_text
from planner.common.result import FolderResult, simulated_section
from planner.common.schema import validate
from planner.common.summary import Summary


@dataclass(frozen=True)
class RecordResult(FolderResult):
    """The record of a robot.

    Attributes:
        changed: the folder of the record, where an entry was added or withdrawn just now.
    """

    main_file = "history.json"
    record: RobotRecord
    changed: Path | None = None

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write the history into a folder.

        Raises:
            InputError: it cannot be written; if the record was changed, how to show it.
        """
        try:
            return super().write(folder, force)
        except InputError as err:
            if self.changed is None:
                raise
            show = f"edbb record {as_word(self.changed)} -o {as_word(folder)}"
            raise InputError(f"{err}. The record itself was changed; show it with {show}") from err

    def overview(self) -> Summary:
        """Return the history in lines."""
        known = self.record
        due = known.due_text and f", next check due {known.due_text}"
        moved, facts = list(known.differences()), []
        for e in known.entries:
            facts.append((e.file.circumstances.date.isoformat(), f"{e.file.kind:<12}{e.sentence}"))
            facts += [("", f"since before: {text}") for number, text in moved if number == e.number]
        return Summary(f"{known.file.serial} ({known.file.robot}): {_count(known)}{due}", facts)

    def content(self) -> Mapping[str, Any]:
        """Return the history as one document."""
        known = self.record
        return {
            "schema": "edbb-history/1",
            "serial": known.file.serial,
            "robot": known.file.robot,
            "next_check": None if known.next_check is None else known.next_check.isoformat(),
            "due": known.due_text,
            "entries": [
                {"number": e.number, "kind": e.file.kind, "result": e.sentence}
                | e.file.circumstances.model_dump(mode="json")
                | {"document_sha256": e.file.document_sha256, **simulated_section(e.simulated)}
                | ({} if e.withdrawn is None else {"withdrawn": e.withdrawn.model_dump(mode="json")})
                for e in known.entries
            ],
        }

    @property
    def simulated(self) -> bool:
        """Tell whether it is made of readings that nobody measured."""
        return self.record.simulated

    def fill(self, draft: Path) -> None:
        """Write ``history.csv``, ``opcua.json`` and the report."""
        from planner.report.check_report import HEAD, record_rows, report_record  # plotting takes long to load

        table = io.StringIO()
        csv.writer(table, lineterminator="\n").writerows([HEAD, *record_rows(self.record)])
        write_text(draft / "history.csv", table.getvalue())
        write_text(draft / "opcua.json", document_text(map_to_opcua(self.record).model_dump(mode="json")))
        report_record(self.record).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "history.json, history.csv, opcua.json, report.html"

    def next_step(self, folder: Path) -> str:
        """Say how the robot is looked at again."""
        due = self.record.due_text and f", due {self.record.due_text}"
        return f"edbb plan-check CELL --model CALIBRATED -o check plans the next check{due}"


def _count(record: RobotRecord) -> str:
    number = len(record.entries)
    return "1 entry" if number == 1 else f"{number} entries"


def record(
    folder: Path | str,
    *,
    add: Path | str | None = None,
    serial: str | None = None,
    circumstances: Circumstances | None = None,
    withdraw: int | None = None,
    reason: str = "",
) -> RecordResult:
    """Show the record of a robot, after adding a folder of results to it, or withdrawing an entry.

    Args:
        folder: of the record; made with the first entry.
        add: folder that ``identify``, ``accuracy`` or ``check`` wrote.
        serial: number of the robot, for a new record.
        circumstances: date (default: today), operator, temperature, tool and gauge of what is added.
        withdraw: number of an entry that counts no more; it stays in the record, with the reason.
        reason: why it is withdrawn.

    Raises:
        InputError: there is no record, or what is to be added does not belong to it.

    Example:
        >>> record("history", add="calibrated", serial="NJ-1")  # doctest: +SKIP
    """
    if withdraw is not None:
        if add is not None:
            raise InputError("name a folder to add, or an entry to withdraw, not both")
        said = {"reason": reason, "by": circumstances.operator if circumstances else "", "date": date.today()}
        withdrawal = validate(said, Withdrawal, "the withdrawal")
        return RecordResult(withdraw_entry(Path(folder), withdraw, withdrawal), Path(folder))
    if add is not None:
        when = circumstances or Circumstances(date=date.today())
        return RecordResult(add_entry(Path(folder), Path(add), when, serial), Path(folder))
    return RecordResult(RobotRecord.read(Path(folder)))
