"""Frames that place the gauge, found from any start on the nominal robot: what a fit begins with."""

from .frames import PER_RADIAN, PointPlacing, PosePlacing, place_points, place_poses
from .lengths import LengthPlacing, place_lengths
from .sockets import SocketPlacing, place_sockets

__all__ = [
    "PER_RADIAN",
    "LengthPlacing",
    "PointPlacing",
    "PosePlacing",
    "SocketPlacing",
    "place_lengths",
    "place_points",
    "place_poses",
    "place_sockets",
]
