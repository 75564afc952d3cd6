"""What decides a result of the circular test besides cell and run: thresholds with their reasons."""

from planner.common.units import DEG

# ---- from where a joint's reversal is read
LEAST_TRAVEL = 0.1 * DEG  # [rad] a joint must turn so far before and after, to have reversed
BESIDE_REVERSAL = 10.0 * DEG  # [rad] of the circle's angle on either side in which it must
REVERSALS_APART = 3.0 * DEG  # [rad] of the circle's angle: reversals nearer than this cannot be told apart
JUMP_WINDOW = 12.0 * DEG  # [rad] of the circle's angle on either side of a reversal, from which its jump is read
JUMP_READINGS = 12  # on either side, at least: three times the unknowns of the parabola with a jump
CHANCE_PLACES = 5  # without a reversal, to know how large a jump is by chance
ANGLE_STEP = 0.5 * DEG  # [rad] in which angles of the joints are averaged and the two directions are compared

# ---- what counts as a sweep
TURNED_ROUND = 2.0 * DEG  # [rad] the arm must go back so far to have turned round
SWEEP_SLACK = 1.0 * DEG  # [rad] that may lack of a sweep: a controller starts and stops the log late
SWEEP_SAMPLES = 100  # at least: fewer do not show a circle's form

# ---- which circle an arm can drive
LARGEST_STEP = 0.6  # [rad] a joint that moved more from one place to the next would be in another configuration
ROOMY_SHARE = 0.6  # of the largest room that a way must have, to be taken because it begins nearer
