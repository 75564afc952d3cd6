"""How large each kind of effect usually is, and the most that is plausible: priors that decide what is found."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Size:
    """Unit of an effect's size, its usual value (one prior sigma) and the largest plausible one."""

    unit: str
    usual: float
    largest: float


@dataclass(frozen=True)
class EffectSize(Size):
    """The same, and where it comes from."""

    literature: str


ESTIMATED = "estimated"
BACKLASH = EffectSize(
    "rad", 1e-4, 1e-2, "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(5): backlash of a serial robot, 0.01-0.1 mm"
)
LOAD_TURN = Size("rad", 3e-4, 1e-2)
"""Turn of a joint, a link or the base under the run's largest load."""
MASS_TURN = Size("rad", LOAD_TURN.usual, 2e-3)
"""Turn of a joint under its largest load by a mass other than stated."""
BASE_TURN = EffectSize("rad", 3e-4, 2e-3, ESTIMATED)
"""Turn of the base by where the tool or the flange is, at the arm's full reach.

Of this size and the next two one robot in thirteen has more, and half have less than a twelfth: docs/effects.md.
"""
LOST_MOTION = EffectSize("rad", 3e-4, 2e-3, "data sheets of strain-wave and cycloidal gears: up to 0.3 mrad")
"""Lost motion of a gear to either side of the middle."""
UNSEEN_LOAD = EffectSize("rad", 1e-4, 2e-3, ESTIMATED)
"""Turn of a joint under loads that no pose has shown, beyond the law that it follows under the others."""
LINK_MASS = Size("1", 0.15, 0.3)
"""Part by which a link weighs more than stated; a run that makes it larger does not show masses."""
GEAR_WAVE = Size("rad", 1e-4, 5e-3)
"""Amplitude of one wave of a gear: one sigma is 20 arc seconds."""
GEAR_CURVE_SIZE = Size("rad", 2e-4, 5e-3)
"""Root mean square of a gear's whole curve."""
SMOOTH_CORRECTION = Size("rad", 3e-4, 1e-2)
"""The longest wave of a smooth correction of a joint; wave k has the k²-th part."""
SESSION_SHIFT = Size("m", 5e-5, 5e-3)
SESSION_TURN = Size("rad", 1e-4, 1e-2)
"""Step of a frame, or of the gauge's zero, from one session to the next."""
SUDDEN_CHANGE = Size("m, rad", 2e-4, 0.2)
"""Sudden change of anything within a run."""
WRONG_ROW = Size("m, rad", 1e-2, 100.0)
"""Error of one row: a digit may be wrong anywhere in a reading."""
EXPANSION = "thermal expansion of steel and aluminium, 11 to 24e-6 1/K"
THERMAL_GROWTH = EffectSize("1/K", 1.2e-5, 1e-4, EXPANSION)
"""Growth of all links: steel; several times as much where the air is not as warm as the arm."""
HEISEL = "Heisel, Richter & Wurst 1997, CIRP Annals 46(1): thermal behaviour of industrial robots, 0.1 to 0.5 mm"
DRIFT_TURN = EffectSize("rad", 2e-4, 5e-3, HEISEL)
DRIFT_SHIFT = EffectSize("m", 5e-5, 3e-3, HEISEL)
"""Drift over a run; the largest in no less than an hour or for no less than 5 K."""

GUIDE = "ISO 230-1: the six errors of a linear axis; sizes estimated"
SLIDE_SCALE = EffectSize("1", 1e-4, 0.05, GUIDE)
"""Scale of a joint that slides: racks of ISO 1328 class 6 to 9 are off by 20 to 100 µm a metre."""
GUIDE_BOW = EffectSize("m", 5e-5, 5e-3, GUIDE)
"""Straightness of a guide that is bolted to a floor or a column."""
CARRIAGE_TILT = EffectSize("rad", 5e-5, 5e-3, GUIDE)
"""Tilt of a carriage from end to end of its guide."""
SLIDE_PLAY = EffectSize("m", 2e-5, 2e-3, ESTIMATED)
"""Play of a rack, a screw or a belt."""
SLIDE_YIELD = EffectSize("m", 5e-5, 5e-3, GUIDE)
"""Yielding of a slide's drive under the run's largest load."""

LAG = EffectSize("s", 2e-3, 0.1, ESTIMATED)
"""Time by which the joints run behind their logged angles."""
SETTLING = EffectSize("1", 0.5, 2.0, ESTIMATED)
"""Factor on what a joint reads less than was commanded: 1 where its angle is the commanded one."""

# ---- sizes of one side
UNKNOWN_PRIOR = 1.0  # [m, rad] prior sigma of a parameter of which nothing is known
LARGEST_COUPLING = 2.5  # a parallelogram that nobody declared couples by -1, a joint counted backwards is off by -2
PLAY_OF_SCATTER = 3.0  # [1] usual play over what a joint repeats to, where that is more than an industrial arm's
PART_TURN = 1e-4  # [rad] of one part about one axis, as of a gear: one sigma of all its waves together
BAR_SHAPE = 3.0  # smooth error of a gauge of lengths over its noise, one sigma of all powers: estimated
RAY_SHAPE = 1e-5  # [m] smooth error of a line of sight: one sigma of all powers together
GAUGE_LAG = 0.05  # [s] one sigma, after the two logs were laid over each other
SET_UP_LARGEST = 0.1  # [m, rad] off: beyond, the gauge was not there at all, and nothing was read
SIGMAS_OF_LARGEST = 5.0  # the largest drift is at least so many of its prior sigmas
