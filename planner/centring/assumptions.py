"""When a gauge that is read live counts as at rest and at the right pose."""

from planner.common.units import MM

AGREEING_READINGS = 5  # in a row that agree: the arm has come to rest
FAR_FROM_PLAN = 15 * MM  # [m] from the planned length: another pose, or a zero that is not set
