"""The loop step by step: what each effect explains, and what gave it away."""

from dataclasses import dataclass, replace

import numpy as np

from planner.effects import Context
from planner.effects.basis import ONE
from planner.identification import Finding, Stage
from planner.model import Model, Parameter
from planner.report.calibration.data import Told
from planner.report.calibration.variables import Variable, variable
from planner.units import Array

MEANS = 24  # points of the line through the residuals; more for an effect of many waves
FAINT = 0.3  # part of its usual leverage below which a reading says nothing of an effect


@dataclass(frozen=True)
class Step:
    """One finding and the stages before and after it was added.

    Attributes:
        name: of its picture.
        what: as its stage and its parameters' group are called.
        replaced: whether it took the place of something, which the stage before then still has.
    """

    finding: Finding
    name: str
    what: str
    before: Stage
    after: Stage
    replaced: bool

    @property
    def inner(self) -> str:
        """Name of the parameter that moves the effect's inner number."""
        return f"{self.what}, {self.finding.inner_name}"


@dataclass(frozen=True)
class Evidence:
    """An effect in the residual, before and after it was in the model.

    Attributes:
        against: what it is drawn against.
        unit: ``rad`` or ``m``, of ``before``, ``after`` and ``fitted``.
        before, after: what the residual says of it, sample by sample, (m,).
        weight: how much each sample says, (m,).
        fitted: what the effect adds as fitted, (m,).
        means: points of the line through the residuals.
    """

    against: Variable
    unit: str
    before: Array
    after: Array
    weight: Array
    fitted: Array
    means: int = MEANS


def steps(told: Told) -> tuple[Step, ...]:
    """Return the findings with their stages, in the order in which they came."""
    c = told.calibration
    out = list[tuple[int, Step]]()
    for f in () if c.traced is None else c.traced.findings:
        what = f"{f.effect}, {f.on}"
        without = [k for k, s in enumerate(c.stages) if what not in s.effects]
        first = min(without[-1] + 1, len(c.stages) - 1)  # one of that name may have come before, and gone
        before = c.stages[max(first - 1, 0)]
        replaced = not set(before.effects) <= set(c.stages[-1].effects)
        out.append((first, Step(f, f"found_{len(out) + 1}", what, before, c.stages[first], replaced)))
    return tuple(step for _, step in sorted(out, key=lambda pair: pair[0]))


def evidence(told: Told, step: Step) -> Evidence:
    """Draw out of the residuals what they say of a step's effect.

    An effect that moves one transform is drawn as that transform's error, each reading's share of it (its residual
    along the transform's screw, over the screw's length) against the quantity it depends on. Others are drawn as the
    part of the residual along what the effect adds, against just that: a line of slope one before, a flat one after.
    What the effect adds is always less what the model before could take up (an added-variable plot; Cook and Weisberg
    1982, section 2.3.2).
    """
    fit, (which, rows) = told.calibration.fit, told.few_rows
    context = Context(fit.model.rig, told.calibration.run.samples.take(which))
    residuals = [s.held_residual[which][:, :3] for s in (step.before, step.after)]
    added = _added(told, step)
    if step.replaced:  # the stage before had something else in its place: what is left with the effect taken out again
        residuals[0] = residuals[1] + added
    own = [p for p in fit.model.parameters if p.group == step.what and p.name != step.inner]
    looked = variable(own[0].main.phi, context) if _single(own) else None
    if looked is None:
        return _pulled(added, residuals)
    first = own[0]
    bare = Model(fit.model.rig, (replace(first, moves=(replace(first.main, phi=ONE),)),))
    screw = bare.linear_in(context, None).rows[:, : rows.shape[1], 0]
    power = (screw**2).sum(axis=1)
    safe = np.maximum(power, (FAINT**2) * max(float(np.median(power)), 1e-300))
    before, after, fitted = (np.einsum("nr,nr->n", r, screw) / safe for r in (*residuals, added))
    turns = first.main.on == "transform" and fit.model.rig.chain.transforms[first.main.index].kind == "rotation"
    means = int(np.clip(3 * len(own), MEANS, len(power) // 10 + MEANS))
    return Evidence(looked, "rad" if turns else "m", before, after, power, fitted, means)


def _added(told: Told, step: Step) -> Array:
    """What an effect adds to the readings (m, r) beyond what the parameters of the stage before could take up."""
    fit, rows = told.calibration.fit, told.few_rows[1]
    groups = [p.group for p in fit.model.parameters]
    own = [k for k, p in enumerate(fit.model.parameters) if p.group == step.what and p.name != step.inner]
    known_then = (step.after if step.replaced else step.before).effects
    rest = [k for k, group in enumerate(groups) if group in ("gauge", "geometry", *known_then)]
    added = rows[:, :, own] @ fit.errors[own]
    known = rows[:, :, [k for k in rest if k not in own]].reshape(added.size, -1)
    known = known / np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    taken = np.linalg.lstsq(known, added.ravel(), rcond=1e-6)[0]
    return np.asarray(added - (known @ taken).reshape(added.shape))


def _single(parameters: list[Parameter]) -> bool:
    """Tell whether all parameters move one and the same transform or number."""
    places = {(m.on, m.index) for p in parameters for m in p.moves}
    return len(places) == 1 and all(len(p.moves) == 1 for p in parameters)


def _pulled(added: Array, residuals: list[Array]) -> Evidence:
    """Residuals (m, r) along what an effect adds (m, r), against that."""
    size = np.linalg.norm(added, axis=1)
    along = added / np.maximum(size, 1e-300)[:, None]
    if added.shape[1] == 1:
        size, along = added[:, 0], np.ones_like(along)
    before, after = (np.einsum("nr,nr->n", r, along) for r in residuals)
    return Evidence(Variable("what the effect adds to the reading (µm)", 1e6 * size), "m", before, after, size**0, size)
