"""What decides a design besides the cell and the plan: sizes that are assumed, and thresholds, with their reasons.

How long and how finely something is searched stands where the search does; it changes the time, hardly the result.
"""

# ---- what is assumed of a robot and its gauge before anything is measured
UNMEASURED_TOOL_PRIOR = 1.0  # [m] prior sigma of a tool point that nobody measured: as good as nothing is known
HIGHEST_GEAR_WAVE = 15.0  # [waves a turn] most of a gear's transmission error lies below
UNSAID_PAYLOAD = 5.0  # [kg] where the robot's file does not say what it carries: small arms carry 3 to 10 kg
SECONDS_BETWEEN_POSES = 10.0  # [s] of travel, about: only the drift of the temperature depends on it
REMEMBERED_POSES = 3  # poses before the measured one that a joint's friction may remember
POSES_OF_AN_OPEN_PLAN = 80  # where the plan does not say how many, what poses teach is judged for so many

# ---- which parameters the candidates can show
STRUCTURAL_ZERO_SHARE = 1e-9
"""Singular values below this share of the largest count as exact zeros.

Columns are scaled by the prior sigmas first. A QR in double precision leaves about P * 2e-16 of rounding there,
analytic columns agree with finite differences to better than 1e-9, and the faintest direction that a robot's geometry
really shows lies above 1e-5: every cut between gives the same rank.
"""
FAINT_SHARE = 0.1
"""A direction is left out when readings and noise alone would know it ten times worse than its prior sigma says.

Between that and the prior sigma itself it is kept and named weak: well-chosen poses see several times more of it than
the average candidate does.
"""
UNSEEN_SHARE = 1e-8  # of the largest singular value: below, the pool does not see a direction
SPAN_SHARE = 1e-6  # of the largest singular value: below, columns do not span a direction
NEW_SPAN_SHARE = 1e-9  # of the largest singular value: below, columns span nothing beyond those before them
VISIBLE_SHARE = 1e-6  # of a column that must remain beside the model's columns for its parameter to count

# ---- how many readings an identification needs
TRACEABLE_READINGS = 20  # beyond the parameters: with fewer the test for normality and the held-out poses say nothing
SPARE_READINGS = 10  # more than that are planned, for the effects' own parameters and poses that are lost
CANDIDATES_PER_PARAMETER = 2  # with fewer candidates there is no choice among them
CLEARLY_TOO_FEW_SHARE = 0.9  # readings per parameter below which no candidates are drawn: the count is from a sample

# ---- when two causes count as told apart
LOG_LIKELIHOOD_EVIDENCE = 9.2  # [-2 ln L] by which the truth must fit better: 2 ln 100, a hundred to one
ALIKE_SHARE = 0.02  # of what a finding explains: an identification keeps a rival that leaves less
UNSURE_POWER = 0.8  # power below which a person is told what would help (Cohen 1988: the usual power of a study)
SURE_POWER = 0.98  # power below which an effect that nobody named is taken up as a rival
IDENTICAL_SHARE = 1e-6  # of a finding's readings: what a rival leaves of them below this is rounding
LEAST_DIFFERENCE = 1.0  # [noise variances] a difference that n poses cannot bring above this is none
LEAST_UNNAMED_DIFFERENCE = 20.0  # [noise variances] the same for a rival that nobody named: it must promise more
OTHER_MEASUREMENT_FACTOR = 2.0  # another measurement is proposed if it shows so many times what is needed, unchosen
INFORMATION_SHARE = 0.25  # of the DT criterion stays with the robot's parameters: they must still be identified
INFORMATION_RIDGE = 1e-8  # of the whole pool's information, added to what n poses have: a direction may be unseen
INDUCED_RIVALS_PER_TRUTH = 2  # rivals that nobody named, taken up for each truth in one round
INDUCED_WEIGHT = 0.5  # of such a rival in the criterion; together they weigh at most half of those that are named

# ---- how many poses, and how large an error
LIMIT_QUANTILE = 0.95  # of robots like this one stay below the error that is stated as a limit
CHANCE_OF_A_LED_ARM = 0.95  # quantile of a led arm's length error that its cell file states as its error
UNTRACED_TARGET_SHARE = 1 / 3  # of what stays untraced: so far the error is brought down if no number is given
FEWEST_POSES, MOST_POSES = 100, 400  # where no number of poses is given
FLAT_SHARE = 0.01  # of the error: if the last tenth of the poses lessens it by no more, others would not either
FEWEST_POSES_AT_A_PLACE = 12  # at a fixture that would have none: its place has to be found
GREEDY_PLACE_PRIOR_SHARE = 1e-2  # of the prior sigmas of the gauge's places in the greedy choice: else they come first
PLACE_LIMITED_SHARE = 0.5  # of the error that is left: if the places cannot show so much, another place may

# ---- where a pose and a fixture may be
TURN_MARGIN_SIGMAS = 3.0  # of a led arm's turn by the arm's own errors: its joints keep so far from their limits
BALL_MARGIN = 2e-4  # [m] beyond the clearance that a pose at a ball keeps: the head stands close to it by design
LEAST_SINGULAR_VALUE = 0.02  # of the tool's Jacobian: nearer to a stretched wrist the arm's errors steer the head
FIXTURES_APART = 0.1  # [m] between two fixtures, at least: their stands take the room
KEPT_POSES_SHARE = 0.5  # of the poses at every fixture must be left beside the stands of the others
WORTH_SHARE = 0.95  # of the error with one fixture: with more it must be smaller to pay for putting them up
STAND_RADII = 2.0  # [bar's radii] of a stand whose size nobody says: at least as stiff as what it holds
CUP_HEIGHT_MM = 30.0  # [mm] from a stand's top to the centre of the ball
STAND_GAP = 0.25  # [m] a body that ends no farther below the fixture than this holds it up
HAND_HEIGHT = 2.0  # [m] above the floor: higher up nobody lays the bar's ball into the cup by hand
UPRIGHT_COSINE = 0.999  # of a body's axis with the vertical: above, it stands straight and can be moved as a stand
