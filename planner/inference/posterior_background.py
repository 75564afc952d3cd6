"""The background of a fit: effects of the catalogue as random effects, with sizes that the run says.

Inner numbers (frequencies, time constants, widths) enter as a band of columns. What a gear, a spring or play does has a
size at each joint. The other kinds have one for all places, since a run says little of each. Kinds that hardly any arm
has, and whose errors would grow beyond the angles measured, enter by name only. A gauge of lengths always errs somewhat
over length and direction: whatever else leads there, smoothly over the poses, goes into the arm's lengths as well, and
no residual shows it.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import N_BASE_TRANSFORMS
from planner.common.units import Array
from planner.effects.catalogue import Background, Excitation, catalogue, effect_kinds, registration_of
from planner.effects.drift_shapes import IN_TIME, drift_shapes
from planner.effects.effect import Effect, Parameter, Role, transform_move
from planner.effects.gauge_shapes import GAUGE_HANGING, GAUGE_SHAPE, gauge_shapes
from planner.effects.gears import WAVES, JointWave
from planner.effects.misfit_shapes import misfit_shapes
from planner.effects.nonparametric import GEAR_CURVE, NONPARAMETRIC
from planner.effects.phi_keys import belongs_to_gauge, is_static
from planner.effects.sizes import GEAR_WAVE
from planner.effects.usual_errors import usual_errors
from planner.fit.assumptions import FIRST_HARMONIC, FIRST_PULL
from planner.model.model import Model
from planner.runs.run import Samples

BACKGROUND = "background"  # group of its parameters
OF_BACKGROUND = " (background)"  # last word of the names of its families in a document
UNNAMED = "misfit"  # what the catalogue has no name for: first word of its families
ABSENT = (Background.NAMED_ONLY, Background.OF_SHAPE, Background.OF_RUN)
NEVER = (Background.OF_SHAPE, Background.KNOWN, Background.OF_RUN)  # whose findings do not enter the robot
BY_PLACE = (Background.BY_PLACE, Background.COMMON)


@dataclass(frozen=True)
class Variant:
    """A finding at another value of its inner number than the one that was fitted."""

    finding: str
    value: float


@dataclass(frozen=True)
class EffectFamily:
    """Parameters that share a factor on their prior sigmas.

    Attributes:
        name, parameters: of the family.
        known: whether the prior sigmas stand as they are.
        common: whether most arms have it, whatever else they have.
        unnamed: whether it is what the catalogue has no name for.
        certain: whether it always acts, and the run says how much.
        usual: whether every robot has it, some a little and few much, be it seen or not.
        variant: what it is where it is a variant of a finding.
    """

    name: str
    parameters: tuple[Parameter, ...]
    known: bool = False
    common: bool = False
    unnamed: bool = False
    certain: bool = False
    usual: bool = False
    variant: Variant | None = None


def variant_family(finding: str, value: float, parameters: Sequence[Parameter]) -> EffectFamily:
    """Return what a finding is at another value of its inner number, by its parameters there."""
    own = tuple(replace(p, group=BACKGROUND) for p in parameters)
    return EffectFamily(f"{finding} at {value:.6g}", own, variant=Variant(finding, value))


def acts_on_robot(parameter: Parameter, setup: MeasurementSetup) -> bool:
    """Tell whether a parameter moves base or robot by joint angles and loads alone, so that a robot's file keeps it."""
    end = N_BASE_TRANSFORMS + len(setup.robot.transforms)
    if parameter.group == "gauge" or any(m.on != "transform" or m.index >= end for m in parameter.moves):
        return False
    return all(is_static(key) and not belongs_to_gauge(key) for key in {m.phi.key for m in parameter.moves})


def background_families(setup: MeasurementSetup, samples: Samples) -> tuple[EffectFamily, ...]:
    """Return the families of the background that the samples can tell of."""
    out: dict[str, list[Parameter]] = {}
    known, common = set[str](), set[str]()
    for effect in catalogue(setup, samples):
        entry = registration_of(effect.kind)
        if entry.background in ABSENT or effect.has(Role.UNTRACED):
            continue
        label = effect.family if entry.background in BY_PLACE else effect.kind
        is_known = entry.background is Background.KNOWN
        known |= {label} if is_known else set()
        common |= {label} if entry.background is Background.COMMON else set()
        out.setdefault(label, []).extend(_band(effect, setup.gauge.scale_sigma if is_known else None))
    for name, parameters in _gears(setup, samples.q):
        out[name] = list(parameters)
    run = Excitation.of(setup, samples)
    for name, shapes in gauge_shapes(run):
        out[name] = list(shapes)
    usual = dict(usual_errors(run))
    out |= {name: list(own) for name, own in usual.items()}
    unnamed = {f"{UNNAMED}, {name}": list(p) for name, p in (*misfit_shapes(run), *drift_shapes(run))}
    return tuple(
        EffectFamily(
            name,
            tuple(replace(p, group=BACKGROUND, prior=p.prior * setup.robot.priors.factor(name)) for p in own),
            name in known,
            name in common,
            name in unnamed,
            # a line of sight is read across as well: what it errs by does not go into the arm unseen
            certain=name in (GAUGE_SHAPE, GAUGE_HANGING) and setup.gauge.width == 1,
            usual=name in usual,
        )
        for name, own in (out | unnamed).items()
    )


def cause_of_family(name: str) -> str | None:
    """Return the name of the cause without a name that a family stands for, as findings have it; ``None`` of others."""
    name = name.removesuffix(f" ({BACKGROUND})")
    if name == GAUGE_SHAPE:
        return f"{NONPARAMETRIC}, gauge"
    if not name.startswith(f"{UNNAMED}, "):
        return None
    where = name.removeprefix(f"{UNNAMED}, ")
    if where.startswith("part "):
        return f"{NONPARAMETRIC}, joint {where.removeprefix('part ')}"
    # lengths, base and gauge that move in time; what else a base does the laws of any shape have
    return f"{NONPARAMETRIC}, {where}" if where.endswith(IN_TIME) else None


def has_name(family: str) -> bool:
    """Tell whether a family, with or without its last word, stands for causes that the catalogue names."""
    kind, _ = _kind_and_place(family.removesuffix(OF_BACKGROUND))
    return kind in effect_kinds() or kind.startswith("gear ")


def is_left_to_background(group: str) -> bool:
    """Tell whether a finding, by the group of its parameters, stays out of the released robot.

    A gauge's error of a shape that only seems right would move all lengths of the arm. What acts by a column that no
    program has would leave the robot without what gravity does to it. A curve without a name is known
    no farther than it was measured. The whole curve of a gear the background has as harmonics and ripple: beside them
    it would stand or fall as a whole, and the draws would hardly ever exchange the one for the others.
    """
    kind, _ = _kind_and_place(group)
    if kind in (NONPARAMETRIC, GEAR_CURVE):
        return True
    return kind in effect_kinds() and registration_of(kind).background in NEVER


def without_rivals_of(curves: Collection[str], families: Sequence[EffectFamily]) -> tuple[EffectFamily, ...]:
    """Return the families without harmonics and ripple of the gears whose whole curves, by their groups, are there."""
    places = {_kind_and_place(group)[1] for group in curves}
    return tuple(f for f in families if not (f.name.startswith("gear ") and _kind_and_place(f.name)[1] in places))


def curve_groups(model: Model) -> frozenset[str]:
    """Return the groups of the model's whole curves of gears."""
    return frozenset(p.group for p in model.parameters if _kind_and_place(p.group)[0] == GEAR_CURVE)


def _kind_and_place(name: str) -> tuple[str, str]:
    """Return the two parts of the name of a group or family; no place where it has none: ``soft base``."""
    kind, _, place = name.partition(", ")
    return kind, place


def _band(effect: Effect, size: float | None) -> Iterator[Parameter]:
    """Yield the effect's parameters, ``size`` large where it is known.

    At some values of its inner number they are together as large as at one of them.
    """
    grid = [v for v in effect.grid if v is not None]
    if not grid:
        yield from (p if size is None else replace(p, prior=size) for p in effect.make())
        return
    few = grid[:: -(-len(grid) // 4)]  # values of any other inner number
    for value in few:
        for p in effect.make(value):
            yield replace(p, name=f"{p.name}, {value:.6g}", prior=p.prior / np.sqrt(len(few)))


def _gears(setup: MeasurementSetup, q: Array) -> Iterator[tuple[str, Iterator[Parameter]]]:
    """Yield harmonics and ripple of every gear that moved, and what a joint does to another, as hoses do; q (n, N)."""
    ripple_count = 24  # frequencies of a gear's ripple in the band
    rotation = {t.joint: k for k, t in enumerate(setup.chain.transforms) if t.joint is not None}
    # 8: harmonics of a gear's error, once to eight times a turn
    slow = [(float(k), FIRST_HARMONIC / np.sqrt(k)) for k in range(1, 8 + 1)]
    # 3: harmonics of what one joint does to another
    pulls = [(float(k), FIRST_PULL / np.sqrt(k)) for k in range(1, 3 + 1)]
    # [1/turn] lowest and highest frequency of a gear's ripple in the band
    ripples = np.geomspace(9.0, 170.0, ripple_count).round(3)
    quick = [(float(f), GEAR_WAVE.usual / np.sqrt(ripple_count)) for f in ripples]
    turning = np.flatnonzero(~setup.robot.slides)
    for joint in (int(j) for j in turning if np.ptp(q[:, j]) > 1e-3):
        # an axis out of centre and one out of round are causes of their own: only so does one stand for none. A gear of
        # which a higher wave is seen errs once and twice a turn as well: where joint angles are measured in two lumps
        # beside free fixtures, once a turn is hardly seen, and what is left of it fits the higher waves
        for name, few in (("once a turn", slow[:1]), ("twice a turn", slow[1:2])):
            yield f"gear {name}, joint {joint + 1}", _waves(rotation[joint], joint, joint, few)
        yield f"gear harmonics, joint {joint + 1}", _waves(rotation[joint], joint, joint, slow, "curve")
        yield f"gear ripple, joint {joint + 1}", _waves(rotation[joint], joint, joint, quick)
        for moved in turning.tolist():
            if moved != joint:
                yield f"joint {moved + 1} by joint {joint + 1}", _waves(rotation[moved], moved, joint, pulls)


def _waves(
    rotation: int, moved: int, joint: int, sizes: Sequence[tuple[float, float]], kind: str = "gear"
) -> Iterator[Parameter]:
    name = f"{kind}{joint + 1}" if moved == joint else f"pull{moved + 1}_{joint + 1}"
    for frequency, size in sizes:
        what = f"error of joint {moved + 1}, {frequency:g} a turn of joint {joint + 1}"
        for wave in WAVES:
            move = transform_move(rotation, JointWave(wave, joint, frequency))
            yield Parameter(f"{name}_{wave}{frequency:g}", "rad", float(size), what, move)
