"""Where the gauge stands by a calibrated robot, where its tool points sit, and what its joint zeros are off."""

from planner.model.document_section import DocumentSection, SectionOfJoint

Vector = tuple[float, float, float]


class FixturePosition(DocumentSection):
    """Where a length gauge's fixture stands in the base frame of the calibrated robot, and its deviations [m]."""

    if_any = ("std_mm",)
    name: str
    position: Vector
    position_std: Vector | None = None


class PlacePose(FixturePosition):
    """How a tracker's or plate's frame stands there; roll, pitch, yaw about the base's fixed axes [rad]."""

    rpy: Vector


class ToolPointPosition(DocumentSection):
    """Where a measured point sits in the flange frame of the calibrated robot, and its standard deviations [m].

    ``position_std`` counts from the true flange; ``std_beside_robot`` is that of the point as it belongs to the robot
    that is released, whose flange counts as known.
    """

    if_any = ("std_mm", "std_beside_robot_mm")
    name: str
    p_FM: Vector
    position_std: Vector | None = None
    std_beside_robot: Vector | None = None


class GaugeFrames(DocumentSection):
    """Where the gauge stands by the calibrated robot; ``zero`` [m] is what a bar reads beyond its length."""

    if_any = ("zero_mm", "zero_std_mm")
    fixtures: tuple[FixturePosition, ...] = ()
    places: tuple[PlacePose, ...] = ()
    tool: tuple[ToolPointPosition, ...] = ()
    zero: float | None = None
    zero_std: float | None = None


class JointZero(SectionOfJoint):
    """What the angle that the controller shows of an axis lacks, and its standard deviation [rad].

    Attributes:
        joint: number of the axis, from 1.
        axes_of: name of the language of the controller whose axes they are; ``None``: the joints of the model.
        offset: to be added to the angle that is shown, by the robot that is released; ``offset_std`` its deviation.
        absorbs: names of parameters that the run does not show and whose error it also carries.
    """

    if_any = ("axes_of", "slides")
    joint: int
    axes_of: str | None = None
    offset: float
    offset_std: float
    absorbs: tuple[str, ...] = ()
