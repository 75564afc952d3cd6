"""What decides which causes are named, besides the run and the fit: evidence, chances and thresholds with reasons."""

from planner.design.assumptions import ALIKE_SHARE

# ---- when an effect is taken up
PARAMETER_COST = 7.0  # [noise variances] a parameter must explain beyond chance, about the log of a run's length
CHANCE_COST = 2.0  # [noise variances] that a parameter explains by chance
LEAST_GAIN = 0.02  # of the squared error, 1 % of the error, that an effect must take away to be worth a name
DETERMINED_VARIANCE = 0.5  # of a direction's prior variance that the readings leave: below, they decide it
SWAP_EVIDENCE = 4.0  # [-2 ln L] fall of the evidence for which an effect is swapped
COMPLIANCE_EVIDENCE = 20.0  # the same for a joint's compliance: every arm has it, it is the likelier cause beforehand
COMPLIANCE_SHARE = 0.95  # of what an effect like compliance explains that makes plain compliance the likelier cause
UNNAMED_EVIDENCE = 20.0  # [noise variances] by which what has no name must be ahead of an effect to take its place
SWAPPED_GAIN_SHARE = 0.9  # of the best gain, above which another candidate is refitted beside it
RETRY_RATIO = 1.3  # times more of the residual than when it was refused: an effect is tried again

# ---- what a finding may be taken for
RIVAL_SHARE = (
    1.0 - ALIKE_SHARE
)  # of a finding's gain that makes another a rival however sure the run is: no model is that exact
DETECTION_POWER = 0.95  # probability with which an effect of the detection limit is found
DETECTION_QUANTILE = 1.645  # [sigma] by which the share of the error must be above what is worth a name: 95 %

# ---- sudden changes and wrong rows
FEWEST_SAMPLES = 3  # on either side of a step: one alone would be a wrong row, of two nobody knows which errs
SHARE_OF_DRIVE = 1 / 40
"""The same of a drive, as share of it: its samples follow each other so closely that a few of them are one.

So long is a stretch that is held out (identification.cross_validation): with less no other samples could bear the step
out.
"""
ALIKE_TRIES = 8
"""Tries that are as good as one: neighbouring samples and things look much alike.

Of 200 clean runs of 80, and of 200, poses the surest step in a hundred had a chance of 0.2 and 0.05 by Bonferroni's
correction for all tries.
"""
LEAST_SLIP = 8.0  # robust standard deviations from which on a row is wrong and no mere outlier
SIMILAR_GAIN_SHARE = 0.7  # of the best step's gain, from which on another step is tried beside it
RANGE_PROBABILITY = 0.95  # of the range of samples in which a step lies
SLIP_SIGMAS = 4.0  # within which a slip of the pen must give the expected reading
OTHER_BALL_SHARE = 0.1  # of a row's error: so near to another ball it was in that one

# ---- masses and curves
LEAST_CURVE_EVIDENCE = 3.0  # [ln L] that curves would add to where the search ended: below, there is no cause for them
QUICKNESSES = (3.0, 6.0, 10.0, 15.0, 20.0, 30.0)  # [waves a turn] within which most of a gear's error may lie
FAINT_WAVE_SHARE = 0.1  # of the strongest wave's power: a fainter one is not named
