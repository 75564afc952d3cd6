"""What decides an identification besides cell and run: noise, priors, probabilities and thresholds, with reasons."""

from dataclasses import dataclass

from planner.common.units import DEG, MM

POSITION_AXES = 3  # of the three axes of a place a bar reads one, a tracker all

# ---- the fit
CONVERGED_SIGMAS = 1e-3  # a step this small, in the parameters' own standard deviations, ends the fit
ROUGHLY_CONVERGED_SIGMAS = 0.05  # the same while noise and priors are still being settled
SETTLED_CHANGE = 0.02  # relative change of noise and factors that ends the rounds
PRIOR_FACTORS = (0.1, 50.0)  # no kind of error is believed to be smaller or larger than this times its prior sigma
ABSORBED_SHARE = 0.02  # of a left-out parameter's direction, per prior sigma: below, nobody need hear of it
TOO_FEW_READINGS = 5  # beyond the parameters: below, nothing is fitted
GAIN_STANDARD_ERRORS = 2.0  # that the held-out error must fall by before an effect is kept

# ---- the noise
LEAST_NOISE_SHARE = 0.02  # of its noise that is left in a residual which its own parameters follow
ENOUGH_FREEDOM = 60  # degrees of freedom below which the declared ratio of the noise variances stands
LARGE_NOISE_RATIO = 2.5  # to the declared noise, which data sheets give to a factor of two: more is not only noise
WILD_PROBABILITY = 0.01  # that a row is wild: of hundreds that a person has made some are; even odds from 4 sigma on
WILD_SCALES = (3.0, 1e6)  # [sigma] of wild rows: from what looks like noise to metres beside micrometres
COUNTED = 0.5  # of a row, from which on it is one of those that the fit stands on
CLIPPED_SIGMAS = 2.5  # robust standard deviations at which outliers are clipped before the residual is tested
SIGNIFICANCE = 0.01  # probability that any test of a clean residual calls

# ---- the posterior: how many causes act, and how large they are
EXPECTED_CAUSES = 3.0  # families of a pool that are expected to act: arms have several causes, seldom one
PREVALENCE = 0.5  # a of the beta prior (a, a · families / EXPECTED_CAUSES) of the share of a pool that acts
STANDING_PROBABILITY = 0.5  # by the run, from which on a finding is said to stand
LOG_NOISE_SIGMA = 0.7  # of the logarithm of the noise: known to a factor of two
LOG_NOISE_RANGE = (-4.0, 6.0)  # of the logarithm of the noise, beyond which nothing is believed
FIRST_HARMONIC = 1.5e-4  # [rad] prior sigma of a gear's first harmonic, the k-th by √k smaller
FIRST_PULL = 1e-4  # [rad] the same of what one joint does to another

# ---- the misfit: what the model does not hold
NO_STRETCH_PROBABILITY = 0.8  # prior
NO_REST_PROBABILITY = 0.5  # prior, before it is known how many families act without a name
NAMELESS_FAMILIES, FAMILIES_OF_A_REST = 1.0, 6.0  # that act where the catalogue has the causes, and where it lacks one
USUAL_NOISE_SHARE = 0.65  # of the noise declared: data sheets say what is kept to, most of all of a repeatability
LOG_USUAL_NOISE_SIGMA = 0.3  # of the logarithm of the noise over the usual one
LOG_STRETCH_SIGMA = 0.7  # of the stretch's logarithm: twice is usual where it is any
USUAL_REST, LOG_REST_SIGMA = 1.0, 1.0  # [usual noise], and of its logarithm: little is known of it
FEW_READINGS_EACH = 1.5  # independent readings for each parameter, below which a fit follows its noise
MISFIT_PROBABILITY = 0.5  # from which on a run is said to show misfit
LOCAL_RATIO = 1.2  # of the misfit at a place to that over the workspace, from which on the place is worth naming

# ---- the released robot
CURVE_STANDARD_ERRORS, CURVE_GAIN = 3.0, 0.1  # that whole curves of gears pay: beyond chance, and of the mean square
DOUBT = 0.02  # probability that geometry alone is the noticeably better robot, at most
NOTICED = 1.05  # ratio of two errors: a twentieth more or less nobody notices at a cell
DENSE_READINGS = 20  # for each parameter, from which poses held out stand for those anywhere
ANOTHER_TOOL_SHARE = 0.5  # of the mean square error of another tool that is worth a second tool point
OTHER_TOOL = 0.2  # [m] from the flange's centre to the tools that were not measured, in six directions
WORTH_SAYING = 0.02  # of what is stated, one sigma, from which on it is said how far other draws would move it
NEGLIGIBLE_SHARE = 0.1  # of the expected error that the written robot may differ from the mean: it adds 0.5 %
UNSEEN_READINGS_RATIO = 100.0  # times as many readings at the same poses: what they leave, this gauge does not see

# ---- from where on a result is doubted
LARGEST_HELD_OUT = 10 * MM  # [m] held-out rms that no calibrated robot leaves
NEAR_DECLARED, NEAR_DECLARED_TURN = 20 * MM, 6 * DEG  # [m], [rad] from the cell's place: beyond, it was moved
FRAME_SIGMAS = 4.0  # of what the arm is off there, by which its run may put the frame off too
STRONG_PULL = 50.0  # [N] from which on where the bar hangs matters to its moments
MUCH_WORSE_RATIO = 3.0  # to the held-out error, from which on that one says little of the rest of the workspace
OTHER_WAY_SHARE = 0.2  # of the error, below which another way of counting the angles is told


@dataclass(frozen=True)
class GrossErrorLimits:
    """From where on what was found is no error that such a robot has, by the sigmas that are declared of it."""

    length_sigmas: float = 10.0  # of a length: measured arms have at most 2, clean simulated ones at most 4
    angle_sigmas: float = 30.0  # of an angle: measured arms have up to 20 (a zero of the Panda, 1.1 deg)
    # no sound robot is farther off, whatever is declared, but for one that may be off by degrees
    length: float = 50 * MM
    angle: float = 5 * DEG  # [rad]
    never_refused_sigmas: float = 6.0
    factor_sigma: float = 1e-2  # of such a scale: a board printed 2 % off, a wire's drum, a length of 100.5 for 100 mm
    least_factor: float = 2e-3  # below, the links of a small arm may share it: 2 mm of a metre
    another_run: float = 30 * MM  # left with the gauge placed: below, no other robot, unit or order of joints is tried


GROSS = GrossErrorLimits()
