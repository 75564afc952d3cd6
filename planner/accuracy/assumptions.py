"""When frames and centred balls count as the same, moved or wrong, and how a robot is judged by other poses."""

from dataclasses import dataclass

from planner.common.units import DEG, MM, UM


@dataclass(frozen=True)
class FrameLimits:
    """When frames and centred balls count as the same, moved or wrong."""

    fewest_nests: int = 3  # of a tracker's frame: a frame has six unknowns
    nest_tolerance: float = 100 * UM  # [m] by which a nest may miss its place after the frame was found
    placing_poses: int = 10  # from which robot and reflector are placed: nine numbers, by three readings a pose
    artifact_off: float = 50 * MM  # [m] by which the artifact's fitted place may miss the cell's
    artifact_turned: float = 0.1  # [rad] the same of how it stands; the tracker's place swings with it
    # [m, rad] from which a frame is said to stand elsewhere
    elsewhere: float = 5 * MM
    tilted: float = 0.5 * DEG
    same_point: float = 1e-3 * MM  # [m] two nominal tool points that are one
    centring_tolerance: float = 3 * UM  # [m] to which balls are centred (TriCal paper, section 3)
    published_centring_um: float = 2.0  # [µm] largest of three centrings against the master ball by a CMM (section 4)


FRAMES = FrameLimits()


@dataclass(frozen=True)
class ValidationRule:
    """How a robot is judged by poses that its calibration did not see."""

    performance_sigmas: float = 3.0  # of the repeatability RP (ISO 9283:1998, 7.2.2)
    fewest_visits: int = 3  # of a pose, to say how it scatters
    # of the standard's own test (ISO 9283:1998)
    standard_visits: int = 30
    standard_poses: int = 5
    fewest_poses: int = 10  # below, no robot is judged
    enough_poses: int = 100  # below, the outer percentiles say little
    percentiles: tuple[int, ...] = (50, 90, 95, 99)  # [%] of the errors that are told
    no_robot_error: float = 200 * MM  # [m] mean error that no robot has, its place in the cell a little wrong


VALIDATION = ValidationRule()
