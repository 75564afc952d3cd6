"""What decides whether a plan's motion is proven, emitted and taken for the one that was planned, with the reasons."""

# ---- rounding of what is printed and read again
SAME_ANGLE = 1e-6  # [rad] by which a way may miss where the next begins, as the numbers of a plan are rounded
PRINTED_TRAVEL = 1e-5  # [m] of travel that the rounding of printed angles may add to a short step
EMITTED_SPEED_RATIO = 1.0 + 1e-3  # of an emitted speed to its limit: angles and times are rounded
CIRCLE_END_OFF = 1e-4  # [rad] by which joints may miss a circle's end: the plan's own points miss it by a micrometre
OFF_CIRCLE, TURNED_TOOL = 1e-6, 1e-6  # [m], [rad] that points may lie off the circle, and the tool may turn
CHANGED_LENGTH_MM, CHANGED_ANGLE_DEG = 1e-3, 1e-6  # [mm], [deg] a plan that differs by more is not this session's
CHANGED_DURATION = 1e-4  # [1] relative, the same of the time that a drive takes

# ---- between the steps of a path
BLEND_MARGIN = 5e-5  # [m] beyond the clearance for blends: the two engines' distances differ by 1e-5
ENCLOSED = 1e-7  # [rad] by which points may lie outside their region: a third of a micrometre at three metres
SMALL_STEP = 0.02  # [rad] of a path that is given in many steps; their corners are anywhere between the steps' ends
DENSE_TRAVEL = 0.002  # [m] of the tool point between two points of a path given in small steps
DENSE_TURN = 0.01  # [rad] of any axis between two such points
CUT_CORNER_SHARE = 0.5  # of such a step, that a controller which prepares blocks slowly may leave the path by
LEG_SPEED_RATIO = 1.01  # what the largest travel and change of length along a leg may exceed the samples' by
STEP_SPEED_RATIO = 1.0005  # the same along a small step
EVEN_TIME_RATIO = 1.1  # of the time on ways that are driven once to the shortest: they are driven at ease

# ---- choices
MUCH_WORSE = 1.5  # times worse that the index may be before a person is told
ROOMY_SHARE = 0.25  # of the mount poses have the most room; of them the quickest to reach is taken
FEW_JOINED_SHARE = 0.2  # of the candidates joined to a mount pose, below which another is tried
REPEATED_CENTRINGS = 3  # of a pose that is repeated (TriCal paper, Table 3)
