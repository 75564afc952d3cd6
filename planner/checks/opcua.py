"""A robot's record as the values of an OPC UA object: ``CalibrationPrognosisType`` (OPC 40210, 8.11).

It is a prognosis as those of OPC 40501-1, 8.6.4 (``PredictedTime``); the robot is named by the properties of a motion
device of OPC 40010-1, 7.2 (from OPC 10000-100). OPC 40010-1 has no calibration of its own.
"""

from datetime import UTC, date, datetime, time

from pydantic import BaseModel, ConfigDict
from pydantic.alias_generators import to_pascal

from planner.checks.record import RobotRecord
from planner.common.units import to_mm
from planner.model.identification_document import Identification


class OpcUaModel(BaseModel):
    """An object whose values stand under their BrowseNames."""

    model_config = ConfigDict(frozen=True, alias_generator=to_pascal, populate_by_name=True, serialize_by_alias=True)


class OpcUaDevice(OpcUaModel):
    """Properties of a ``MotionDeviceType``."""

    serial_number: str
    model: str


class OpcUaPrognosis(OpcUaModel):
    """Properties of a ``CalibrationPrognosisType``; what is unknown is null."""

    predicted_time: datetime | None
    calibrated: bool
    date_of_calibration: datetime | None
    calibration_interval: float
    calibration_certificate: tuple[str, ...]


class OpcUaRecord(OpcUaModel):
    """Both with their types, and the error of the tool to be expected [mm], which no companion specification has."""

    device_type: str = "http://opcfoundation.org/UA/Robotics/;MotionDeviceType"
    device: OpcUaDevice
    prognosis_type: str = "http://opcfoundation.org/UA/GMS/;CalibrationPrognosisType"
    prognosis: OpcUaPrognosis
    expected_tool_error_mm: float | None


def map_to_opcua(record: RobotRecord) -> OpcUaRecord:
    """Return the record as OPC UA values, times at the beginning of the day (UTC).

    Where a check has failed the robot is not calibrated, and the predicted time is that of the check.
    """
    found = [(e.file.circumstances, e.document) for e in record.valid_entries if isinstance(e.document, Identification)]
    prognosis = OpcUaPrognosis(
        predicted_time=_begin(record.next_check),
        calibrated=record.calibration_date is not None,
        date_of_calibration=_begin(found[-1][0].date) if found else None,
        calibration_interval=record.file.check_days * 86_400_000.0,  # OPC UA counts a Duration in ms
        calibration_certificate=tuple(c.certificate for c, _ in found[-1:] if c.certificate),
    )
    device = OpcUaDevice(serial_number=record.file.serial, model=record.file.robot)
    error = float(to_mm(found[-1][1].workspace_error)) if found else None
    return OpcUaRecord(device=device, prognosis=prognosis, expected_tool_error_mm=error)


def _begin(day: date | None) -> datetime | None:
    return None if day is None else datetime.combine(day, time(), UTC)
