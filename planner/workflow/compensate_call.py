"""The verb ``compensate``, declared."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from planner.common.calls import LANGUAGE, Call, Option, upload_option
from planner.workflow.declared import CALIBRATED

if TYPE_CHECKING:
    from planner.workflow.identification import CalibrationResult

NUMBERS = "-?[0-9.eE+-]{1,30}(,-?[0-9.eE+-]{1,30}){5}"
AXES = "^ *[0-9]{1,3} *(, *[0-9]{1,3} *){0,30}$"
FRAME = "X,Y,Z,A,B,C"  # mm, and degrees about Z, Y', X"


@dataclass(frozen=True)
class CompensateCall(Call):
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""

    verb = "compensate"
    line = "Correct a program for the calibrated robot."
    group = "Use"
    function = "planner.workflow.compensation:compensate"

    targets: Annotated[
        Path | str,
        Option(
            "a robot program, or targets as CSV",
            metavar="PROGRAM|TARGETS",
            is_word=True,
            typed=Path,
            request_name="program",
        ),
    ]
    _: KW_ONLY
    model: Annotated["CalibrationResult | Path | str", CALIBRATED]
    dialect: Annotated[str | None, Option("language of the file, or csv, where it does not tell", pattern=LANGUAGE)] = (
        None
    )
    tool: Annotated[
        str | None,
        Option(
            "tool in the flange, mm and degrees, or the model's",
            metavar=f"{FRAME}|model",
            pattern=f"^({NUMBERS}|model)$",
        ),
    ] = None
    base: Annotated[str | None, Option("base of poses, mm and degrees", metavar=FRAME, pattern=f"^{NUMBERS}$")] = None
    frames: Annotated[Path | str | None, upload_option("tools and bases: $config.dat, a module", "FILE")] = None
    strict: Annotated[bool, Option("write nothing unless every target of the file can be corrected")] = False
    cell: Annotated[
        str | None, Option("the cell, to make sure that its controller does not correct too", metavar="CELL")
    ] = None
    again: Annotated[bool, Option("add to the correction by another model, whose mark the file bears")] = False
    measuring: Annotated[bool, Option("correct a measuring program too, whose path is proven uncorrected only")] = False
    despite_change: Annotated[bool, Option("on a server: correct although the calibration holds no more")] = False
    date: Annotated[
        str | None,
        Option(
            "in the mark of the file (default: of the model's file)",
            metavar="YYYY-MM-DD",
            pattern="^[0-9]{4}-[0-9]{2}-[0-9]{2}$",
        ),
    ] = None
    axes_of: Annotated[
        str | None,
        Option("of the controller whose axes a table's joint angles are", metavar="LANGUAGE", pattern=LANGUAGE),
    ] = None
    turn_weights: Annotated[
        str | None,
        Option(
            "of an arm of fewer than six axes: what the tool's axis counts, and the turn about it (default: 1,0.3)",
            metavar="AXIS,TURN",
            pattern="^[0-9.]{1,9},[0-9.]{1,9}$",
        ),
    ] = None
    force: Annotated[
        bool, Option("correct by a robot, too, of which its identification says not to use it", python_only=True)
    ] = False
    zeros_set: Annotated[
        Sequence[int],
        Option(
            "axes whose zeros were set in the controller by this identification",
            metavar="2,3,…",
            typed=str,
            pattern=AXES,
        ),
    ] = ()
