"""A section of a document: SI units in memory, the units that the keys name in the file."""

from math import isfinite
from typing import Annotated, ClassVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from planner.common.units import DEG, MM, file_unit, si_unit

KEYS = {
    "schema_": "schema",
    "rms": "rms_mm",
    "mean": "mean_mm",
    "largest": "max_mm",
    "spread": "spread_mm",
    "structured_rms": "structured_rms_mm",
    "estimates": "parameters",
    "gain": "held_out_gain",
    "noise_floor": "noise_floor_mm",
    "workspace_error": "known_anywhere_mm",
    "anywhere": "anywhere_mm",
    "nominal_anywhere": "nominal_anywhere_mm",
    "at_most": "at_most_mm",
    "geometry_anywhere": "geometry_anywhere_mm",
    "other_tool": "other_tool_mm",
    "where_measured": "where_measured_mm",
    "position": "position_mm",
    "rpy": "rpy_deg",
    "p_FM": "map_mm",
    "position_std": "std_mm",
    "std_beside_robot": "std_beside_robot_mm",
    "offset": "zero_deg",
    "offset_std": "std_deg",
    "zero": "zero_mm",
    "zero_std": "zero_std_mm",
    "seen": "seen_mm",
    "unseen": "unseen_mm",
    "misfit": "misfit_mm",
    "drift": "drift_mm",
    "warmth": "temperature_degC",
    "there": "there_mm",
    "elsewhere": "elsewhere_mm",
    "least": "least_mm",
    "most": "most_mm",
    "range": "range_deg",
    "targets_within": "within_mm",
    "targets_within_before": "within_before_mm",
    "other_tool_within": "other_tool_within_mm",
    "tolerance": "tolerance_mm",
    "repeatability": "repeatability_mm",
}
"""Field of a section and its key in the file, where they differ."""
SCALES = {"_mm": MM, "_deg": DEG, "held_out_gain": MM}  # by the end of a key


def _scale(key: str) -> float:
    return next((scale for end, scale in SCALES.items() if key.endswith(end)), 1.0)


def _times(value: object, factor: float) -> object:
    """Scale a number or a list of numbers; what is neither is left to the check of its type."""
    if isinstance(value, list | tuple):
        return [_times(v, factor) for v in value]
    return value if factor == 1.0 or isinstance(value, bool) or not isinstance(value, int | float) else value * factor


def _without_rounding(value: object) -> object:
    """Return 1 for what a sum of chances was rounded up to."""
    return 1.0 if isinstance(value, float) and 1.0 < value < 1.0 + 1e-9 else value


Size = Annotated[float, Field(ge=0)]
"""Of what has no sign, such as a root mean square."""
Probability = Annotated[float, BeforeValidator(_without_rounding), Field(ge=0, le=1)]


class DocumentSection(BaseModel):
    """A part of the document; keys of the file that are unknown here are passed over."""

    model_config = ConfigDict(frozen=True, populate_by_name=True, alias_generator=lambda name: KEYS.get(name, name))
    in_unit: ClassVar[tuple[str, ...]] = ()
    """Fields in the section's ``unit``, which is an SI unit in memory."""
    if_any: ClassVar[tuple[str, ...]] = ()
    """Fields that the file leaves out where they are ``None``."""

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: object) -> object:
        if not isinstance(data, dict):
            return data
        out = {key: _times(value, _scale(key)) for key, value in data.items()}
        if cls.in_unit and isinstance(data.get("unit"), str):
            out["unit"], factor = si_unit(data["unit"])
            out |= {key: _times(out[key], factor) for key in cls.in_unit if key in out}
        return out

    @model_serializer(mode="wrap")
    def _to_file(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        out = {k: _times(v, 1 / _scale(k)) for k, v in handler(self).items() if v is not None or k not in self.if_any}
        if self.in_unit:
            out["unit"] = file_unit(str(out["unit"]))
            out |= {key: _times(out[key], 1 / si_unit(str(out["unit"]))[1]) for key in self.in_unit}
        return out


IN_DEGREES = {"zero_mm": "zero_deg", "std_mm": "std_deg", "range_mm": "range_deg"}  # keys of a joint that slides


class SectionOfJoint(DocumentSection):
    """What is said of one joint [rad]; of one that ``slides`` the file says it in mm, a millimetre for a degree."""

    slides: bool | None = None

    @model_validator(mode="before")
    @classmethod
    def _of_slide(cls, data: object) -> object:
        if not isinstance(data, dict) or not {"zero_mm", "range_mm"} & data.keys():
            return data
        return {IN_DEGREES.get(key, key): value for key, value in data.items()} | {"slides": True}

    @model_serializer(mode="wrap")
    def _to_file(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        out = super()._to_file(handler)
        if not self.slides:
            return out
        in_mm = {degrees: key for key, degrees in IN_DEGREES.items()}
        return {in_mm.get(key, key): value for key, value in out.items() if key != "slides"}

    @property
    def unit(self) -> str:
        """The unit that a person reads it in."""
        return " mm" if self.slides else "°"


def round_digits(value: object) -> object:
    """Return a document with its numbers to nine digits; one that is not finite is no number."""
    if isinstance(value, dict):
        return {k: round_digits(v) for k, v in value.items()}
    if isinstance(value, list):
        return [round_digits(v) for v in value]
    if not isinstance(value, float):
        return value
    return float(f"{value:.{9}g}") + 0.0 if isfinite(value) else None
