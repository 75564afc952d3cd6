"""Random truths for blind tests: an arm with random errors and effects of random kind, place and size."""

import numpy as np

from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.sizing import Implausible
from tests.simulation.generator.truth import Noise, draw_truth

USUAL = Noise()
DRAWS = 40  # random effects that are tried before a run is given up


def random_effect(arm, kind, rng, share=None, joint=None):
    """An effect of a kind at a random joint, with random inner numbers; its size by share, or likely at random."""
    row = KINDS[kind]
    joint = int(rng.choice(row.places(arm))) if joint is None else joint
    inner = tuple(sorted((k, float(v)) for k, v in row.inner(rng, arm, joint).items()))
    size = float(np.exp(rng.uniform(*np.log(row.sizes(arm, joint))))) * rng.choice([-1.0, 1.0])
    if share is not None or kind in UNSIGNED:
        size = abs(size)
    return Effect(kind, joint, size, inner, share)


UNSIGNED = frozenset(
    {"joint-compliance", "payload-compliance", "force-compliance", "link-bending", "soft-base", "tool-compliance",
     "soft-floor-xy", "link-twist", "thermal-links", "unsettled", "gauge-sag", "gauge-lag", "gauge-filter", "servo-lag"}
)  # fmt: skip


def shown_by(gauge, moving, in_catalogue=True):
    """Names of the kinds that a run of this gauge can show; ``None`` for those in and out of the catalogue."""
    rows = (k for k in KINDS.values() if k.allows(gauge, moving))
    return tuple(k.name for k in rows if in_catalogue is None or k.in_catalogue == in_catalogue)


def random_truth(arm, kinds, rng, share, count=1, noise=USUAL, mass_spread=0.0):
    """A truth with ``count`` effects out of ``kinds``, no two of one kind at one joint, each at ``share``."""
    effects = {}
    while len(effects) < count:
        e = random_effect(arm, str(rng.choice(kinds)), rng, share)
        effects.setdefault((e.kind, e.joint), e)
    return draw_truth(arm, int(rng.integers(2**31)), effects.values(), noise, mass_spread)


def random_run(build, arm, seed, kinds, share, count=1, noise=USUAL, mass_spread=0.0, **how):
    """``build(arm, seed=…, truth=…, **how)`` with a random truth, drawn again while its effects are implausible."""
    return _plausible(
        build, arm, seed, lambda rng: random_truth(arm, kinds, rng, share, count, noise, mass_spread), how
    )


def as_in_a_real_arm(build, arm, seed, share, noise=USUAL, mass_spread=0.15, **how):
    """A run with gravity compliance of three joints, ripple on two, backlash on one and a drift; masses misjudged."""
    return _plausible(build, arm, seed, lambda rng: _several(arm, rng, share, noise, mass_spread), how)


def _several(arm, rng, share, noise, mass_spread):
    loaded = sorted(rng.choice(range(2, arm.n_joints), 3, replace=False))
    geared = rng.choice(range(1, arm.n_joints), 2, replace=False)
    drift = str(rng.choice(["joint-drift", "warm-up"]))
    effects = [random_effect(arm, "joint-compliance", rng, share, int(j)) for j in loaded]
    effects += [random_effect(arm, "reducer-ripple", rng, share, int(j)) for j in geared]
    effects += [random_effect(arm, kind, rng, share) for kind in ("backlash-approach", drift)]
    return draw_truth(arm, int(rng.integers(2**31)), effects, noise, mass_spread)


def _plausible(build, arm, seed, draw, how):
    for attempt in range(DRAWS):
        try:
            return build(arm, seed=seed, truth=draw(np.random.default_rng([seed, 6, attempt])), **how)
        except Implausible as found:
            last = found
    raise Implausible(f"none of {DRAWS} draws is plausible on {arm.name}; the last one: {last}")
