"""Settings of a centring (``edbb-centring/1``), completed by what the cell says."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, PositiveInt, field_validator

from planner.cell.file import ArtifactFile, ControllerFile, GaugeFile
from planner.common.errors import InputError, did_you_mean
from planner.common.schema import NonNegativeFloat, PartialModel, PositiveFloat, StrictModel, read_toml
from planner.common.units import MM, Array
from planner.kinematics.bodies import Vector


class RefusedReadingError(Exception):
    """The indicator answered that it cannot measure; the message says why."""


@dataclass(frozen=True)
class IndicatorProtocol:
    """How indicators are asked and how they answer.

    Attributes:
        baudrate, bytesize, parity, stopbits: of the line, in pyserial's words.
        request: channel (from 1) → the bytes that ask for its reading.
        value: an answer without its end, and the channel → the reading [m]; ``None`` where it is not a whole one.
        end: last byte of an answer.
        channels: whether several indicators may share one port.
    """

    baudrate: int
    bytesize: int
    parity: str
    stopbits: int
    request: Callable[[int], bytes]
    value: Callable[[bytes, int], float | None]
    end: bytes = b"\r"
    channels: bool = False


SYLVAC_VALUE = re.compile(rb"[+\- ]?(\d+\.\d{2,5})")
SYLVAC_ERRORS = {
    b"ERR0": "sensor error (too fast, or the scale)",
    b"ERR1": "it does not know the request",
    b"ERR2": "parity error on its line",
    b"ERR3": "out of its measuring range",
}
MITUTOYO_VALUE = re.compile(rb"0(\d)A([+-][\d.]{8})")
MITUTOYO_ERROR = re.compile(rb"91[0-9]\d?")


def _sylvac_value(answer: bytes, channel: int) -> float | None:
    text = answer.strip(b"\n")
    if text in SYLVAC_ERRORS:
        raise RefusedReadingError(SYLVAC_ERRORS[text])
    return float(text.replace(b" ", b"")) * MM if SYLVAC_VALUE.fullmatch(text) else None


def _mitutoyo_value(answer: bytes, channel: int) -> float | None:
    """Another channel's answer is no reading either."""
    text = answer.strip(b"\n")
    if MITUTOYO_ERROR.fullmatch(text):
        raise RefusedReadingError(f"no data from the indicator (error {text.decode()})")
    found = MITUTOYO_VALUE.fullmatch(text)
    if found is None or int(found[1]) != channel or found[2].count(b".") != 1:
        return None
    return float(found[2]) * MM


PROTOCOLS = {
    # one indicator a port, in millimetres as set on the instrument: the answer names no unit; ``?`` CR asks; over
    # cable, Bluetooth or V-MUX (Sylvac, manuals of the Opto-RS and Power instruments, "Data format", "Remote commands")
    "sylvac": IndicatorProtocol(4800, 7, "E", 2, lambda channel: b"?\r", _sylvac_value),
    # one a port, or three on channels 1 to 3 of a multiplexer; a channel's number and CR ask, 01A+0000.123 CR answers
    # (Mitutoyo manual 99MAF600B, QM-Height, "USB data output specification"); the request, and 91x of a unit that has
    # no data, are those usual for its multiplexers
    "mitutoyo": IndicatorProtocol(9600, 8, "N", 1, lambda channel: b"%d\r" % channel, _mitutoyo_value, channels=True),
}


def find_protocol(name: str) -> IndicatorProtocol:
    """Return the language called ``name``.

    Raises:
        InputError: there is no such one.
    """
    if name not in PROTOCOLS:
        known = sorted(PROTOCOLS)
        raise InputError(f"no indicator protocol {name!r}{did_you_mean(name, known)} (there are: {', '.join(known)})")
    return PROTOCOLS[name]


Matrix = tuple[Vector, Vector, Vector]
ToolNumber = Annotated[int, Field(ge=1, le=128)]  # of KUKA's TOOL_DATA and BASE_DATA
Micrometres = Annotated[float, Field(gt=0, le=500)]  # half a millimetre: no ball is centred by more
Stroke = Annotated[float, Field(gt=0, le=25)]  # of an indicator [mm]
SmallAngle = Annotated[float, Field(gt=0, le=45)]
BaseNumber = Annotated[int, Field(ge=0, le=128)]
KRL_WORDS = "def|end|deffct|endfct|loop|halt|wait|brake|resume|return|switch|global|interrupt|trigger|centre"


def _controller_name(text: str) -> str:
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,23}", text) and not re.fullmatch(KRL_WORDS, text, re.IGNORECASE):
        return text
    raise ValueError("a program is called by 1 to 24 letters, digits and underscores, and by no word of KRL")


ProgramName = Annotated[str, AfterValidator(_controller_name)]


def _check_protocol(name: str) -> str:
    try:
        find_protocol(name)
    except InputError as err:
        raise ValueError(str(err)) from err
    return name


class HeadSettings(StrictModel):
    """``[head]``: the three indicators.

    ``matrix`` brings their readings to the ball's place in the tool frame: each column is the direction, in the
    controller's tool frame, in which its indicator reads positive. Without it the tool frame lies along the indicators
    (``tool_frame = "head"``, as in the paper) or is turned as the flange is (``"flange"``: the cell says how the
    indicators stand in it).
    """

    protocol: Annotated[str, AfterValidator(_check_protocol)] = "sylvac"
    tool_frame: Literal["head", "flange"] = "head"
    matrix: Matrix | None = None
    usable_mm: Stroke = 5.0  # the disk tips meet a 1-inch ball up to here; beyond −usable nothing touches
    check_free: bool = True  # before each contact every plunger must stand at its free end
    timeout_s: PositiveFloat = 1.0  # of one answer
    tries: PositiveInt = 4  # of one reading

    @field_validator("matrix")
    @classmethod
    def _check_invertible(cls, value: Matrix | None) -> Matrix | None:
        if value is not None and np.linalg.cond(np.array(value)) > 10.0:
            raise ValueError("the directions of the three indicators do not span space; rows are x, y, z of the tool")
        return value


class RestSettings(StrictModel):
    """``[rest]``: when readings are believed: ``readings`` in a row within ``spread_um``."""

    readings: Annotated[int, Field(ge=2)] = 5
    spread_um: Micrometres = 3.0
    most_readings: PositiveInt = 100
    settle_s: NonNegativeFloat = 0.3  # after a move, before the first reading


class MoveSettings(StrictModel):
    """``[moves]``: when the ball is centred, and how far the robot may go for it."""

    tolerance_um: Micrometres = 3.0
    first_step_mm: Stroke = 0.5  # shows whether every indicator follows before anything larger is moved
    step_mm: Annotated[float, Field(gt=0, le=5)] = 2.0  # the robot's program takes no longer one
    travel_mm: Annotated[float, Field(gt=0, le=15)] = (
        7.5  # from the planned pose: beyond 7.04 mm not all three tips touch
    )
    most_moves: PositiveInt = 60
    judge_mm: Stroke = 0.15  # an indicator is judged by how it followed once it should have moved this far


class RobotSettings(StrictModel):
    """``[robot]``: the controller. ``plate_rpy_deg`` turns the plate's axes in the controller's base."""

    program: ProgramName = "EDBB_CENTRE"
    tool: ToolNumber = 1
    base: BaseNumber = 0
    ptp_percent: Annotated[int, Field(ge=1, le=100)] = 10
    touch_percent: Annotated[int, Field(ge=1, le=10)] = 1  # to a ball and away from it
    speed_mm_s: Annotated[float, Field(gt=0, le=250)] = 5.0
    answer_s: PositiveFloat = 2.0
    move_s: PositiveFloat = 120.0
    arrive_s: PositiveFloat = 900.0  # for the plan's own program to come to the next ball, "--follow"
    poll_s: PositiveFloat = 0.05
    silence_s: PositiveFloat = 3.0  # the robot's own program stops a move when the planner is silent for so long
    timer: Annotated[int, Field(ge=1, le=32)] = 10  # the controller's timer that watches for it
    arrived_deg: SmallAngle = 0.05
    start_deg: SmallAngle = 3.0  # how near to the planned path the robot must stand at the start, on each axis
    plate_rpy_deg: Vector = (0.0, 0.0, 0.0)


class CentringSettings(StrictModel):
    """The whole file; everything has a default."""

    schema_: Literal["edbb-centring/1"] = Field(default="edbb-centring/1", alias="schema")
    head: HeadSettings = HeadSettings()
    rest: RestSettings = RestSettings()
    moves: MoveSettings = MoveSettings()
    robot: RobotSettings = RobotSettings()

    @property
    def to_tool(self) -> Array:
        """Matrix from the three readings to the ball's centre in the tool frame, (3, 3)."""
        return np.eye(3) if self.head.matrix is None else np.array(self.head.matrix)


S = TypeVar("S", bound=StrictModel)


class CentringCellPart(PartialModel):
    """What the cell says of the head, the plate and the controller."""

    gauge: GaugeFile | None = None
    artifact: ArtifactFile | None = None
    controller: ControllerFile = ControllerFile()


def read_settings(path: Path | None, cell: Path) -> CentringSettings:
    """Read the settings at ``path``, the defaults where there is none; what it leaves out the ``cell`` may say.

    Raises:
        InputError: a file is missing, is no TOML, or a key is wrong; or the cell should say how the head stands.
    """
    given = CentringSettings() if path is None else read_toml(path, CentringSettings)
    found = read_toml(cell, CentringCellPart) if cell.is_file() else CentringCellPart()
    head, numbers = None if found.gauge is None else found.gauge.head, found.controller
    robot: dict[str, object] = {} if found.artifact is None else {"plate_rpy_deg": found.artifact.rpy_deg}
    robot |= {k: v for k, v in (("tool", numbers.tool), ("base", numbers.base)) if v is not None}
    said: dict[str, object] = {} if head is None else {"usable_mm": head.usable_mm}
    if given.head.tool_frame == "flange" and given.head.matrix is None:
        if head is None:
            raise InputError(
                f"{cell}: 'gauge.head.indicators' is missing; it says how the indicators stand in the flange, which "
                "'tool_frame' = \"flange\" needs"
            )
        axes = np.array(head.indicators)
        said["matrix"] = tuple(map(tuple, (axes / np.linalg.norm(axes, axis=1)[:, None]).T.tolist()))
    return given.model_copy(
        update={"head": _fill_defaults(given.head, said), "robot": _fill_defaults(given.robot, robot)}
    )


def _fill_defaults(section: S, said: Mapping[str, object]) -> S:
    """Take over what the cell says, except where the settings say it themselves."""
    return section.model_copy(update={k: v for k, v in said.items() if k not in section.model_fields_set})
