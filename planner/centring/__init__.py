"""Auto-centring at the cell: three indicators are read, the robot follows them to the ball, each pose is recorded."""

from planner.centring.bench import Bench, Session
from planner.centring.centre import Centred, centre
from planner.centring.errors import CentringError
from planner.centring.indicators import Indicators, SerialIndicators, open_indicators
from planner.centring.link import RobotLink
from planner.centring.opening import open_link
from planner.centring.program import centring_program, write_centring_program
from planner.centring.protocols import PROTOCOLS, Language, protocol
from planner.centring.session import open_session, run_session
from planner.centring.settings import Settings
from planner.centring.settings_file import read_settings
from planner.centring.stopping import Stop, on_signals

__all__ = [
    "PROTOCOLS",
    "Bench",
    "Centred",
    "CentringError",
    "Indicators",
    "Language",
    "RobotLink",
    "SerialIndicators",
    "Session",
    "Settings",
    "Stop",
    "centre",
    "centring_program",
    "on_signals",
    "open_indicators",
    "open_link",
    "open_session",
    "protocol",
    "read_settings",
    "run_session",
    "write_centring_program",
]
