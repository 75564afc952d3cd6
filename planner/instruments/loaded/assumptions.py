"""What decides a result of the loaded bar besides cell and run: thresholds and what is assumed, with their reasons."""

from planner.common.units import DEG, MM, UM

# ---- which circles a robot may drive
NEAREST_SHARE, FURTHEST_SHARE = 0.35, 0.85  # of the reach, from axis 1: nearer it folds, farther it stretches
TOP_SHARE = 0.75  # of the reach: the highest centre of a circle
LIMIT_MARGIN = 0.03  # [rad] from joint limits, from the ball joint's cones, and of a singular pose
TYPICAL_COMPLIANCE_SHARE = 0.5  # of its prior sigma each joint is taken to yield, to foresee what the height does
WORST_JOINT_SHARE = 0.15  # of the prior sigma: more places are said to be worth it until the worst joint is known so

# ---- what the samples of a run mean
SMALL_LOAD = 2.0  # [N] a bar that pulls less is not loaded; kilonewtons in the column look like that
LEAST_FORCE_SHARE = 0.01  # of the samples in a bin of force: less is the change from one step to the next
FINEST_GRID, COARSEST_GRID = 360, 36  # angles of a turn: a degree, and five for each of the harmonics that are used
SAMPLES_AN_ANGLE = 4  # at least, else the scatter of the repeats is not known
TURN_SLACK = 1.5 * DEG  # [rad] that a whole turn may lack: a controller starts and stops the log late
LOST_SAMPLES = 3  # the same in samples, where they are sparse
SENSE_WINDOW = 1.0 * DEG  # [rad] over which the sense of travel is seen above the scatter
ON_CIRCLE_SHARE = 0.5  # of a place's samples must lie on a circle, else there is none
SENSE_SHARE = 0.2  # of a tracker's samples make a sense of travel; fewer are the way back
LEAST_COVERAGE = 0.9  # of the angles that the tracker's samples must cover
PAPER_OVERSHOOT = 180.0 * DEG  # [rad] of the EDBB paper's circles, where a cell says nothing

# ---- the model of the deflection
LOW_HARMONICS = 5  # harmonics of a turn in which the deflections lie
SPREAD_HARMONICS = 8  # over which the arm's repeatability along a circle is spread
NOISE_VARIANCE_RATIO = 2.0  # of what is left to the repeats: beyond it is no chance, and the scatter left is the noise
FAINTEST_INFORMATION = 1e-12  # of the largest, in prior sigmas: what is below is rounding
STILL_SHARE = 1e-5  # of the prior sigmas: a step that changes nothing
HEIGHT_STEP = 0.5 * MM  # [m] for the numeric derivative by the fixture's height: it is almost linear there

# ---- the joint fit with a calibration run
SAMPLE_SPACING = 3.0  # [s] from one sample of a continuous run to the next that enters: neighbours share their error
SPARSE_STEP = 300  # the same in samples, where the run has no times
ANGLES_A_TURN = 24  # of each turn enter: neighbours share their error, and curves vary a few times a turn
DISAGREEMENT_RATIO = 3.0  # of the scatter that a run leaves beside the other to what it leaves by itself

# ---- what a person is told
RANGE_MARGIN = 10.0 * MM  # [m] beyond the bar's range that cell and program may be wrong by
SURE_SIGMAS = 3.0  # a negative compliance beyond so many is no chance: the sign of a column is wrong
CURVED_OFFSET = 10.0 * UM  # [m] second harmonic of an offset centre, beyond which its sine is not the whole truth
OVERLOAD_RATIO = 1.1  # of the measured load to the largest that the cell states
LINEAR_LOADS = 3  # loads that it takes to see whether the arm yields in proportion
AGREEING_RATIO = 1.5  # of what is left to the scatter of the repeats: beyond it the loads' curves do not agree
# standard deviation as a part of the prior sigma: below the first a value is known, above the second not at all
KNOWN_SHARE, OPEN_SHARE = 1.0 / 3.0, 1.0
NEGLIGIBLE_SHARE = 0.05  # of the largest share of a combination: less is not written, and hides no joint behind another
