"""What decides a result of the circular test besides cell and run: thresholds with their reasons."""

from dataclasses import dataclass

from planner.common.units import DEG


@dataclass(frozen=True)
class ReversalReading:
    """From where on the circle a joint's reversal is read."""

    least_travel: float = 0.1 * DEG  # [rad] a joint must turn so far before and after, to have reversed
    beside_reversal: float = 10.0 * DEG  # [rad] of the circle's angle on either side in which it must
    reversals_apart: float = 3.0 * DEG  # [rad] of the circle's angle: reversals nearer than this cannot be told apart
    # [rad] of the circle's angle on either side of a reversal, from which its jump is read
    jump_window: float = 12.0 * DEG
    jump_readings: int = 12  # on either side, at least: three times the unknowns of the parabola with a jump
    chance_places: int = 5  # without a reversal, to know how large a jump is by chance
    # [rad] in which angles of the joints are averaged and the two directions are compared
    angle_step: float = 0.5 * DEG


REVERSAL = ReversalReading()


@dataclass(frozen=True)
class SweepRule:
    """What counts as a sweep."""

    turned_round: float = 2.0 * DEG  # [rad] the arm must go back so far to have turned round
    sweep_slack: float = 1.0 * DEG  # [rad] that may lack of a sweep: a controller starts and stops the log late
    sweep_samples: int = 100  # at least: fewer do not show a circle's form


SWEEP = SweepRule()


@dataclass(frozen=True)
class DrivableSweeps:
    """Which circle an arm can drive."""

    # [rad] a joint that moved more from one place to the next would be in another configuration
    largest_step: float = 0.6
    roomy_share: float = 0.6  # of the largest room that a way must have, to be taken because it begins nearer


DRIVABLE = DrivableSweeps()
