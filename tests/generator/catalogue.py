"""The table of all kinds of effects, and what several of them together do to an arm and to its gauge."""

import numpy as np

from tests.generator import effects_gauge, effects_heat, effects_joint, effects_load
from tests.generator.scene import total

KINDS = {k.name: k for room in (effects_load, effects_joint, effects_heat, effects_gauge) for k in room.KINDS}


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
