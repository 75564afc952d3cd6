"""What decides whether a path is proven and how fast it is driven, besides cell and limits, with the reasons."""

# ---- bodies
LEAST_SIZE = 1e-3  # [m] largest side of a mesh: nothing in a cell is smaller
CARRIED_REACHES = 3.0  # [robot's reach] no body that it carries is larger
HALL = 30.0  # [m] no mesh of an obstacle is larger: one in millimetres that is read in metres is
FARTHEST_VERTEX = 1e3  # [m] from a mesh's own zero: nothing in a cell is a kilometre away
FLAT_THICKNESS = 1e-6  # [m] below, a mesh encloses no space
HULL_TOLERANCE = 1e-3  # [m] that a polytope may stand beyond the hull's faces before it gets more of them
MOST_TRIANGLES = 50_000  # of a mesh as it is: with 200 000 the second engine takes a second a state
BODY_GAP = 0.025  # [m] between bodies at a joint: shipped arms have up to 10 mm
OTHER_ARM_GAP = 0.05  # [m] from which bodies that somebody wrote are another arm's
OVERLAP_STATES = 256  # drawn states in all of which two bodies touch if they always do

# ---- distances and proofs
DISTANCE_SLACK = 1e-5  # [m] that a proof of a distance may lack of it, and that fcl's collision test is given
CLEARANCE_TOLERANCE = 1e-5  # [m] to which the smallest clearance of a path is found
READING_TOLERANCE = 5e-4  # [m] to which the bar's lengths on a path are found
DETOUR_MARGINS = (1e-4, 1e-3)  # [m] beyond the clearance: the judges' distances differ by 1e-5; and a wider try
MOST_BISECTIONS = 26  # of a motion; what is still open is not proven (a margin below some 1e-7 of the motion)
SUPPORT_COST = 0.1  # [s] of a support pose beyond its way: each is a corner to blend

# ---- timing
SAME_POINT = 1e-8  # [rad] path points nearer than this are one point
REVERSAL_COSINE = 1e-6  # 1 + cos of a turn below this is a reversal: nothing to blend, the tour must stop
PACE_RATIO = 4.0  # the two halves of a blend may differ by this factor in time at the pace of their legs
STRAIGHT_SPEED_RATIO = 1.0 + 2e-4  # what a maximum between two samples of a straight may exceed the samples by
BLEND_SPEED_RATIO = 1.0 + 1e-2  # the same within a blend
NO_JERK_LIMIT = 1e9  # [m/s³] of a reading: nothing in a gauge is hurt by it
CURVATURE_SHARE = 0.9  # of the acceleration and jerk limits that curvature alone may use: room to change the speed
STRETCH_CHANGE = 0.03  # relative change of the speed limit that begins a new stretch
"""Finer stretches cost time to compute, coarser ones give away speed."""
PHASE_TOLERANCE = 1e-6  # relative to a step's own length and speed: ruckig's own accuracy is 1e-8
