"""``catalogue()``: every effect that a rig and the logged columns of a run can show."""

from collections.abc import Callable, Iterator

from planner.catalogue import gauge, gears, heat, play, sessions, weights, yielding
from planner.catalogue.site import Site
from planner.catalogue.types import Entry
from planner.rig import Rig
from planner.run import Samples

KINDS: tuple[Callable[[Site], Iterator[Entry]], ...] = (
    yielding.joint_compliance,
    yielding.drive_compliance,
    weights.payload_compliance,
    yielding.link_bending,
    yielding.soft_base,
    yielding.tool_compliance,
    weights.wrong_mass,
    gears.encoder,
    gears.named_ripple,
    gears.ripple,
    gears.ratio,
    gears.coupling,
    gears.wobble,
    play.backlash,
    play.backlash_by_load,
    play.hysteresis,
    play.unsettled,
    play.servo_lag,
    heat.link_growth,
    heat.drift,
    heat.warm_up,
    gauge.bar,
    gauge.balls,
    gauge.interpolation,
    gauge.frame,
    sessions.zero_step,
    sessions.frame_step,
    sessions.remounting,
)  # fmt: skip


def catalogue(rig: Rig, samples: Samples) -> tuple[Entry, ...]:
    """Return every entry that the rig can have and the samples can tell of.

    What needs a column that was not logged, or that never changes, is left out. Entries stand in a fixed order.
    """
    site = Site.of(rig, samples)
    return tuple(entry for kind in KINDS for entry in kind(site))
