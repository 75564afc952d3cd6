"""Gives an effect the size at which it leaves a stated share of the noise after geometry."""

import numpy as np

import tests.simulation.generator.oracle as oracle
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.made import MANY, change, columns

MOST = 2.0  # times the largest plausible size
STEPS = 4  # secant steps; one is enough for effects in proportion to their size


class Implausible(ValueError):
    """The share would need an effect larger than any real arm has: geometry takes nearly all of it."""


def scale_to(share, effect, scene, station, truth, noise_rms):
    """The effect with the size whose RMS after geometry is ``share`` × ``noise_rms`` [m].

    Raises:
        Implausible: no real arm has an effect that large.
    """
    rows = np.unique(np.linspace(0, len(scene.t) - 1, min(MANY, len(scene.t))).astype(int))
    J = columns(scene, station, truth, rows)[0]
    kind = KINDS[effect.kind]
    sizes = kind.sizes(scene.arm, effect.joint)
    size = float(np.sqrt(np.prod(sizes)))
    for _ in range(STEPS):
        made = change(scene, station, truth, effect.of_size(size))[rows]
        have = oracle.rms(oracle.left_over(J, made, noise_rms / np.sqrt(made.shape[1])))
        factor = share * noise_rms / have if have > 0 else np.inf
        size *= factor
        if not size < MOST * sizes[1]:
            raise Implausible(f"{effect.kind} at joint {effect.joint} would need {size:.2g} {kind.unit}")
        if abs(factor - 1) < 1e-3:
            break
    return effect.of_size(size)
