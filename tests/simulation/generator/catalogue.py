"""The table of all kinds of effects, and what several of them together do to an arm and to its gauge."""

from dataclasses import replace

import numpy as np

import tests.simulation.generator.effects_gauge as effects_gauge
import tests.simulation.generator.effects_heat as effects_heat
import tests.simulation.generator.effects_joint as effects_joint
import tests.simulation.generator.effects_load as effects_load
from tests.simulation.generator.scene import total

# what the identifier may call an effect, at the same joint or link; besides the names in the tables of kinds
SAID = {
    "joint-compliance": ("joint compliance", "payload compliance", "compliance under drive torque"),
    "payload-compliance": ("payload compliance", "joint compliance"),
    "force-compliance": ("joint compliance",),
    "link-bending": ("link bending",),
    "link-twist": ("link bending",),
    "encoder-once": ("encoder once a turn",),
    "encoder-twice": ("encoder twice a turn",),
    "reducer-ripple": ("gear ripple",),
    "strain-wave": ("strain-wave error", "gear ripple"),
    "gear-uneven": ("gear error curve", "gear ripple", "encoder once a turn", "encoder twice a turn"),
    "sawtooth": ("gear ripple", "gear error curve"),
    "wobble": ("axis wobble once a turn", "axis wobble twice a turn", "axis wobble three times a turn"),
    "reduction-ratio": ("reduction ratio",),
    "coupling": ("coupling",),
    "backlash-speed": ("backlash", "hysteresis"),
    "backlash-approach": ("backlash", "hysteresis"),
    "backlash-torque": ("backlash by load",),
    "hysteresis": ("hysteresis", "backlash"),
    "servo-lag": ("servo lag",),
    "thermal-joint": ("thermal drift",),
    "joint-drift": ("drift", "warm-up"),
    "warm-up": ("warm-up", "drift"),
    "warm-up-two": ("warm-up", "drift"),
}
# the same wherever it is said to sit
SAID_ANYWHERE = {
    "soft-base": ("soft base",),
    "soft-floor-xy": ("soft base",),
    "tool-compliance": ("tool compliance",),
    "wrong-payload": ("payload mass", "joint compliance", "payload compliance"),
    "unsettled": ("unsettled angle",),
    "thermal-links": ("link growth",),
    "base-drift": ("drift",),
    "gauge-scale": ("gauge scale",),
    "gauge-growth": ("gauge growth",),
    "gauge-nonlinearity": ("gauge nonlinearity",),
    "gauge-lag": ("gauge lag", "servo lag"),
    "gauge-filter": ("gauge lag", "servo lag"),
    "gauge-sag": ("gauge sag",),
    "gauge-interpolation": ("scale interpolation",),
    "ball-centre": ("ball centre",),
    "session-step": ("session step",),
}


def _said(kind):
    """The kind with what the identifier may call it."""
    return replace(
        kind,
        right=(*kind.right, *SAID.get(kind.name, ())),
        right_anywhere=(*kind.right_anywhere, *SAID_ANYWHERE.get(kind.name, ())),
    )


KINDS = {k.name: _said(k) for room in (effects_load, effects_joint, effects_heat, effects_gauge) for k in room.KINDS}


def motions(scene, effects):
    """Slot → (n,) motion [m or rad] that the effects of the arm add to it."""
    acting = [e for e in effects if KINDS[e.kind].moves is not None]
    return total({}, *(KINDS[e.kind].moves(scene, e) for e in acting))


def read(scene, effects, reading, bar):
    """Reading (n, k) after the effects of the gauge."""
    for e in effects:
        if KINDS[e.kind].reads is not None:
            reading = KINDS[e.kind].reads(scene, e, reading, bar)
    return np.asarray(reading)


def logs(effects):
    """Which columns a run must carry for these effects."""
    return frozenset(name for e in effects for name in KINDS[e.kind].logs)


def unknown(effects):
    """Kinds that are not in the table."""
    return sorted({e.kind for e in effects} - set(KINDS))
