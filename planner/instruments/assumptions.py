"""What the instruments assume and from where on they object, with the reasons; each larger one has its own."""

from planner.common.units import DEG, MM, UM

# ---- how a session is set up and driven
CUP_SIGMA = 0.05 * MM  # [m] of a cup that is adjusted to a ball by hand, and of a zero that is set there
CORRELATION_TIME = 1.0  # [s] over which the joints' deviation from where they read is correlated while moving
FIXTURE_CHANGE_TIME = 60.0  # [s] for taking the bar to the next fixture
NEXT_SESSION_POSES = 20  # of a session after another one, where nobody gives a number: about ten minutes
UNKNOWN_PRIOR = 1.0  # [m, rad] prior sigma of what stands anew and has none

# ---- the live gauge
AGREEING_READINGS = 5  # in a row that agree: the arm has come to rest
AGREEING_SPREAD = 0.05 * MM  # [m] between the largest and the smallest of them
FAR_FROM_PLAN = 15 * MM  # [m] from the planned length: another pose, or a zero that is not set

# ---- records and frames
MOVED_SIGMAS = 3.0  # of the difference between two calibrations: a parameter beyond has moved
FEWEST_NESTS = 3  # of a tracker's frame: a frame has six unknowns
NEST_TOLERANCE = 100 * UM  # [m] by which a nest may miss its place after the frame was found
PLACING_POSES = 10  # from which robot and reflector are placed: nine numbers, by three readings a pose
ARTIFACT_OFF = 50 * MM  # [m] by which the artifact's fitted place may miss the cell's
ARTIFACT_TURNED = 0.1  # [rad] the same of how it stands; the tracker's place swings with it
ELSEWHERE, TILTED = 5 * MM, 0.5 * DEG  # [m, rad] from which a frame is said to stand elsewhere
SAME_POINT = 1e-3 * MM  # [m] two nominal tool points that are one
CENTRING_TOLERANCE = 3 * UM  # [m] to which balls are centred (TriCal paper, section 3)
PUBLISHED_CENTRING_UM = 2.0  # [µm] largest of three centrings against the master ball by a CMM (section 4)

# ---- validation
PERFORMANCE_SIGMAS = 3.0  # of the repeatability RP (ISO 9283:1998, 7.2.2)
FEWEST_VISITS = 3  # of a pose, to say how it scatters
STANDARD_VISITS, STANDARD_POSES = 30, 5  # of the standard's own test (ISO 9283:1998)
FEWEST_POSES = 10  # below, no robot is judged
ENOUGH_POSES = 100  # below, the outer percentiles say little
PERCENTILES = (50, 90, 95, 99)  # [%] of the errors that are told
NO_ROBOT_ERROR = 200 * MM  # [m] mean error that no robot has, its place in the cell a little wrong
