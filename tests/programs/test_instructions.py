"""A program that makes no sense is refused when it is made."""

import dataclasses
import math

import pytest

from planner.cell.file import ControllerFile
from planner.common.errors import InputError
from planner.programs.instructions import Dwell, Instruction, JointMove, LogAxes, Pause, Program, Sync

HOME = (0.0,) * 6
MOVE = JointMove(HOME, 1.0, 10.0, 50.0)
ROUNDED = dataclasses.replace(MOVE, blend_mm=5.0)


def _program(*instructions: Instruction, **changes: object) -> Program:
    fields = {"plan_id": "0" * 12, "robot": "r", "n_joints": 6, "home_deg": HOME, "instructions": instructions}
    return Program(**{**fields, "controller": ControllerFile(), **changes})  # type: ignore[arg-type]


def test_a_good_one() -> None:
    assert _program(MOVE, Sync(1), LogAxes(1), Dwell(1.0), ROUNDED, Sync(2), LogAxes(2), MOVE).moves == (
        MOVE,
        ROUNDED,
        MOVE,
    )


@pytest.mark.parametrize(
    ("instructions", "changes", "message"),
    [
        ((), {}, "no move"),
        ((MOVE,), {"plan_id": "xyz"}, "12 hex digits"),
        ((MOVE,), {"home_deg": (0.0,) * 5}, "home has 5 angles"),
        ((MOVE, dataclasses.replace(MOVE, q_deg=(0.0,) * 7)), {}, "move 2 has 7 angles"),
        ((dataclasses.replace(MOVE, q_deg=(math.nan, *HOME[1:])),), {}, "no finite number"),
        ((dataclasses.replace(MOVE, duration_s=0.0),), {}, "duration_s = 0.0"),
        ((dataclasses.replace(MOVE, duration_s=math.nan),), {}, "duration_s = nan"),
        ((dataclasses.replace(MOVE, axis_percent=101.0),), {}, "axis_percent = 101"),
        ((dataclasses.replace(MOVE, blend_mm=-1.0),), {}, "blend_mm = -1"),
        ((ROUNDED, MOVE), {}, "first and the last move"),
        ((MOVE, ROUNDED), {}, "first and the last move"),
        ((MOVE,), {"mass_kg": -1.0}, "-1.0 kg"),
        ((MOVE,), {"map_mm": (0.0, math.nan, 0.0)}, "no sensible number"),
        ((MOVE, ROUNDED, Dwell(1.0), MOVE), {}, "only a move that ends in an exact stop .* Dwell"),
        ((MOVE, ROUNDED, Sync(1), Pause("x"), MOVE), {}, "only a move that ends in an exact stop .* Pause"),
        ((MOVE, Dwell(0.0)), {}, "out of range"),
    ],
)
def test_refused(instructions: tuple[Instruction, ...], changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        _program(*instructions, **changes)
