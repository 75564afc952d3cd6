"""What the compliance of a joint would explain together with weights that are not what the files say.

Without them a compliance whose torques are a tenth off would lose against entries with more freedom.
"""

from dataclasses import replace

import numpy as np

from planner.tracing.dictionary import products
from planner.tracing.masses import KIND, PART, weights
from planner.tracing.screen import Scored, Shade


def with_weights(shade: Shade, scores: list[Scored]) -> list[Scored]:
    """Return the scores, those of the joints' compliances with the weights as likely to be off as they are."""
    return [_weighed(shade, s) if s.entry.kind == KIND and s.gain > 0 else s for s in scores]


def _weighed(shade: Shade, plain: Scored) -> Scored:
    """Score a compliance again, beside the parts by which each weight on it may be off (ridge regression)."""
    parameters = plain.entry.make(None)
    first, model = parameters[0], shade.problem.model
    joint = model.rig.chain.transforms[first.main.index].joint
    if len(parameters) > 1 or joint is None:
        return plain
    size = float(plain.along[0] / plain.information[0, 0]) * first.prior
    both = (*parameters, *(replace(p, prior=PART) for p in weights(model, [(joint, size)])))
    entry = replace(plain.entry, make=lambda _: both)
    dictionary = shade.lay_out([(entry, None)])
    done = products(dictionary, shade.problem, shade.errors, shade.basis, shade.residual)
    hold = np.r_[0.0, np.full(len(both) - 1, shade.variance)]
    G, a = done.squares[0] - done.shadow.T @ done.shadow + np.diag(hold), done.along
    return replace(plain, gain=max(plain.gain, float(a @ np.linalg.lstsq(G, a)[0])))
