"""What decides whether a target is solved, unchanged or refused in a correction, with the reasons."""

from planner.common.units import DEG, MM

# ---- solving for joint angles
SOLVED = 1e-9  # [m and rad] by which a solved target may miss: below what programs print
LARGEST_STEP = 0.1  # [rad] of any joint in one iteration
JACOBIAN_STEP = 1e-6  # [rad] of the numeric Jacobian
REACHED = 1e-7  # [m and rad] by which the nominal arm may miss a pose that it reaches
LOST_DIRECTION_SHARE = 1e-7  # of the largest singular value: below, the arm has lost a direction
PLACE_WEIGHTS = (300.0, 1e5)  # [1/m] of a few-axes arm's place, a turn counting 1/rad: which at last moves it 10 nm
MOVE_WEIGHT = 1e-3  # [1/rad] the same of a joint's own move: it decides where no place or turn does
SINGULAR_SHARE = 0.2  # of an arm's usual smallest singular value: below, it is near a singular position
COARSE_ARM_SIGMAS = 10.0  # of an angle's error before calibration: so far may a correction of a coarse arm move

# ---- what a program says, and what is written
SAME = 1e-6  # [m, m² or rad] nearer to a border, rounding decides on which side a joint stands: what is written stays
SHAPE_BORDER = 1e-3  # [m or rad] closer to the border between two shapes of the arm, either name will do
WRIST_OFF = 1e-5  # [m] within which axes 4 and 6 must meet on axis 5
JOINT_OFF = 1e-3  # [rad] between what is read and what was meant: another turn is 2π, another shape far more
PLACE_OFF = 5e-6  # [m and rad] of the calibrated flange, from rounding alone
OVER_LIMIT = 0.5 * DEG  # [rad] a taught angle may stand a little over a limit
START_OFF = 60 * MM  # [m] joint angles that a search starts from may be rounded; a base or a gripper is farther off
START_TURN = 20.0 * DEG  # [rad] the same of the tool's turn; another convention of angles turns it by more at some pose
CONVENTION_OFF = 3.0 * DEG  # [rad] from where on another convention is looked for
CONVENTION_AGREES = 0.5 * DEG  # [rad] within which it must agree at all poses: what rounded joint angles leave
FARTHEST = 1e4  # [m, rad] no target, tool or base of a robot is farther away

# ---- what a person is told
TOLD_JOINT_MOVE = 2.0 * DEG  # [rad] a joint that moves by more for a correction of millimetres is told
UNEXPLAINED_TURN = 1.0 * DEG  # [rad] change of A or C that no correction of the orientation explains
MISSED_TURN = 0.05 * DEG  # [rad] a turn that the arm misses by more is told; people write hundredths of a degree
WORSE_RATIO = 1.001  # of the error after a correction to the one before: less is rounding
