"""What decides a result of the loaded bar besides cell and run: thresholds and what is assumed, with their reasons."""

from dataclasses import dataclass

from planner.common.units import DEG, MM, UM


@dataclass(frozen=True)
class DrivableCircles:
    """Which circles a robot may drive."""

    # of the reach, from axis 1: nearer it folds, farther it stretches
    nearest_share: float = 0.35
    furthest_share: float = 0.85
    top_share: float = 0.75  # of the reach: the highest centre of a circle
    limit_margin: float = 0.03  # [rad] from joint limits, from the ball joint's cones, and of a singular pose
    # of its prior sigma each joint is taken to yield, to foresee what the height does
    typical_compliance_share: float = 0.5
    # of the prior sigma: more places are said to be worth it until the worst joint is known so
    worst_joint_share: float = 0.15


DRIVABLE = DrivableCircles()


@dataclass(frozen=True)
class SampleReading:
    """What the samples of a run mean."""

    small_load: float = 2.0  # [N] a bar that pulls less is not loaded; kilonewtons in the column look like that
    least_force_share: float = 0.01  # of the samples in a bin of force: less is the change from one step to the next
    # angles of a turn: every degree, and every ten
    finest_grid: int = 360
    coarsest_grid: int = 36
    samples_an_angle: int = 4  # at least, else the scatter of the repeats is not known
    turn_slack: float = 1.5 * DEG  # [rad] that a whole turn may lack: a controller starts and stops the log late
    lost_samples: int = 3  # the same in samples, where they are sparse
    sense_window: float = 1.0 * DEG  # [rad] over which the sense of travel is seen above the scatter
    on_circle_share: float = 0.5  # of a place's samples must lie on a circle, else there is none
    sense_share: float = 0.2  # of a tracker's samples make a sense of travel; fewer are the way back
    least_coverage: float = 0.9  # of the angles that the tracker's samples must cover
    paper_overshoot: float = 180.0 * DEG  # [rad] of the EDBB paper's circles, where a cell says nothing


SAMPLES = SampleReading()


@dataclass(frozen=True)
class DeflectionModel:
    """How the deflection along a circle is modelled and solved."""

    low_harmonics: int = 5  # harmonics of a turn in which the deflections lie
    spread_harmonics: int = 8  # over which the arm's repeatability along a circle is spread
    # of what is left to the repeats: beyond it is no chance, and the scatter left is the noise
    noise_variance_ratio: float = 2.0
    faintest_information: float = 1e-12  # of the largest, in prior sigmas: what is below is rounding
    still_share: float = 1e-5  # of the prior sigmas: a step that changes nothing
    height_step: float = 0.5 * MM  # [m] for the numeric derivative by the fixture's height: it is almost linear there


DEFLECTION = DeflectionModel()


@dataclass(frozen=True)
class JointFit:
    """How the loaded circles are fitted together with a calibration run."""

    # [s] from one sample of a continuous run to the next that enters: neighbours share their error
    sample_spacing: float = 3.0
    sparse_step: int = 300  # the same in samples, where the run has no times
    angles_a_turn: int = 24  # of each turn enter: neighbours share their error, and curves vary a few times a turn
    disagreement_ratio: float = 3.0  # of the scatter that a run leaves beside the other to what it leaves by itself


JOINT_FIT = JointFit()


@dataclass(frozen=True)
class Warnings:
    """From where on a person is told."""

    range_margin: float = 10.0 * MM  # [m] beyond the bar's range that cell and program may be wrong by
    sure_sigmas: float = 3.0  # a negative compliance beyond so many is no chance: the sign of a column is wrong
    # [m] second harmonic of an offset centre, beyond which its sine is not the whole truth
    curved_offset: float = 10.0 * UM
    overload_ratio: float = 1.1  # of the measured load to the largest that the cell states
    linear_loads: int = 3  # loads that it takes to see whether the arm yields in proportion
    # of what is left to the scatter of the repeats: beyond it the loads' curves do not agree
    agreeing_ratio: float = 1.5
    # standard deviation as a part of the prior sigma: below the first a value is known, above the second not at all
    #
    known_share: float = 1.0 / 3.0
    open_share: float = 1.0
    # of the largest share of a combination: less is not written, and hides no joint behind another
    negligible_share: float = 0.05


TOLD = Warnings()
