"""``catalogue()``: every effect that a setup and the logged columns of a run can show."""

from collections.abc import Callable, Iterator

import planner.effects.backlash as play
import planner.effects.compliance as weights
import planner.effects.compliance as yielding
import planner.effects.gears as gears
import planner.effects.sessions as sessions
import planner.effects.thermal as heat
from planner.cell.setup import MeasurementSetup
from planner.effects.effect import Effect, Excitation
from planner.runs.run import Samples

EFFECT_SOURCES: tuple[Callable[[Excitation], Iterator[Effect]], ...] = (
    yielding.joint_compliance,
    yielding.drive_compliance,
    weights.payload_compliance,
    yielding.link_bending,
    yielding.base_compliance,
    yielding.tool_compliance,
    weights.wrong_mass,
    gears.encoder_eccentricity,
    gears.stated_gear_ripple,
    gears.gear_ripple,
    gears.reduction_ratio,
    gears.coupling,
    gears.axis_wobble,
    play.backlash,
    play.backlash_by_load,
    play.hysteresis,
    play.settling,
    play.servo_lag,
    heat.link_growth,
    heat.drift,
    heat.warm_up,
    lambda site: site.setup.gauge.errors(site),
    sessions.zero_step,
    sessions.frame_step,
    sessions.remounting,
)  # fmt: skip


def catalogue(setup: MeasurementSetup, samples: Samples) -> tuple[Effect, ...]:
    """Return every entry that the setup can have and the samples can tell of.

    What needs a column that was not logged, or that never changes, is left out. Entries stand in a fixed order.
    """
    site = Excitation.of(setup, samples)
    return tuple(entry for kind in EFFECT_SOURCES for entry in kind(site))
