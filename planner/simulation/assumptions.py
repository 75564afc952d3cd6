"""How a simulated session is set up and driven."""

from planner.common.units import MM

CUP_SIGMA = 0.05 * MM  # [m] of a cup that is adjusted to a ball by hand, and of a zero that is set there
CORRELATION_TIME = 1.0  # [s] over which the joints' deviation from where they read is correlated while moving
