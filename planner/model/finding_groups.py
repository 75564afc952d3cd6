"""The one list of causes: many of one kind as the one thing that they are, the likeliest first.

A reflector that was seated anew and play in joint after joint are draws of one random effect: its size each time, or at
each joint, has a root mean square, which n of them tell within 1 / √(2 n) of itself.
"""

from collections.abc import Iterable, Sequence
from typing import get_args

import numpy as np

from planner.common.units import MM, display_unit, format_value
from planner.model.finding import Finding, Grade, Member

JOINT = "joint "


def list_causes(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return causes as they are told everywhere: many of one kind as one, by grade, then probability.

    Of those as likely in whole percent, what takes most away comes first. A list that is told so already stays.
    """
    kinds: dict[tuple[str, ...], list[Finding]] = {}
    for k, f in enumerate(findings):
        kinds.setdefault(_kind_of(f) or (str(k),), []).append(f)
    # 3: findings of one kind from which on they are one
    every = [f for own in kinds.values() for f in ([_together(own)] if len(own) >= 3 else own)]
    return tuple(sorted(every, key=_order))


def _order(f: Finding) -> tuple[int, float, float]:
    sure = 1.0 if f.probability is None else f.probability
    return get_args(Grade).index(f.grade), -round(sure, 2), -f.gain


def _kind_of(f: Finding) -> tuple[str, ...] | None:
    """What a finding has in common with others of its kind, doubt included; ``None`` where it stands alone."""
    if f.members is not None:
        return None
    doubt = "doubtful" if f.is_doubtful else ""  # one doubtful joint makes no doubt of five that are certain
    if f.after_sample is not None:
        return f.effect, f.on, f.unit, doubt
    is_one_joint = f.on.removeprefix(JOINT).isdigit() and f.inner is None and f.row is None
    return (f.effect, JOINT, f.unit, doubt) if is_one_joint else None


def _together(own: Sequence[Finding]) -> Finding:
    """Return findings of one kind as one."""
    first, (value, std) = own[0], _common_size(own)
    steps = first.after_sample is not None
    known = [f.probability for f in own if f.probability is not None]
    joints = sorted(int(f.on.removeprefix(JOINT)) for f in own) if not steps else []
    chance = dict[str, float]()
    for f in own:
        for name, p in zip(f.rivals, f.rival_probabilities or [0.0] * len(f.rivals), strict=True):
            if not name.startswith(f"{first.effect}, "):
                chance[name] = max(chance.get(name, 0.0), p)
    rivals = sorted(chance, key=lambda name: -chance[name])
    are_judged = any(f.rival_probabilities is not None for f in own)
    surely = [f for f in own if f.p_value is not None]
    least = max(surely, key=lambda f: f.log_p) if surely else None
    return Finding(
        effect=first.effect,
        on=first.on if steps else f"joints {', '.join(map(str, joints))}",
        value=value,
        std=std,
        unit=first.unit,
        p_value=None if least is None else least.p_value,
        log10_p=None if least is None else least.log10_p,
        gain=max(f.gain for f in own),
        probability=min(known) if known else None,
        rivals=tuple(rivals),
        rival_probabilities=tuple(chance[r] for r in rivals) if are_judged else None,
        note=(_steps_note if steps else _joints_note)(own),
        beside_stages=None if surely else True,
        members=tuple(own),
    )


def _common_size(own: Sequence[Member]) -> tuple[float, float]:
    """Root mean square of sizes, in SI units, and how well so few draws tell it.

    That is of the random effect, not of any one of them, and no text writes it behind a size.
    """
    value, std = np.array([f.value for f in own]), np.array([f.std for f in own])
    size = float(np.sqrt(max(float((value**2 - std**2).mean()), float((std**2).mean()))))
    return size, size / float(np.sqrt(2 * len(value)))


def unit_of_change(unit: str, size: float) -> tuple[str, float]:
    """Return how what changed by about ``size`` in the SI ``unit`` is written, and the factor to it."""
    # 1e-4: [m] from which on what changed is said in millimetres
    return ("mm", 1 / MM) if unit == "m" and abs(size) > 1e-4 else display_unit(unit, size)


def group_text(own: Sequence[Member]) -> str:
    """Say how many of one kind there are, and from which size to which."""
    first = own[0]
    if first.after_sample is None:
        unit = display_unit(first.unit, max(abs(f.value) for f in own))
        return f"{first.effect} of {len(own)} joints, {_sizes_text(own, *unit)}"
    unit = unit_of_change(first.unit, _common_size(own)[0])
    return f"{first.on}: changed {len(own)} times, by {_sizes_text(own, *unit)}"


def _sizes_text(own: Sequence[Member], unit: str, factor: float) -> str:
    """``121 to 298 µrad (root mean square 205)``: how they differ, which no deviation of their mean would say."""
    sizes = [abs(f.value) * factor for f in own]
    least, most, mean = (f"{float(f'{v:.3g}'):g}" for v in (min(sizes), max(sizes), _common_size(own)[0] * factor))
    return f"{least} to {most} {unit} (root mean square {mean})" if least != most else f"{most} {unit} each"


def _steps_note(own: Sequence[Finding]) -> str:
    """Say how often something changed, by how much, and when."""
    when = ", ".join(str(k) for k in sorted(f.after_sample or 0 for f in own))
    return f"{group_text(own)}, after samples {when}"


def _joints_note(own: Sequence[Finding]) -> str:
    """Say the sizes that the joints have together, and that of each with its own deviation."""
    unit = display_unit(own[0].unit, max(abs(f.value) for f in own))
    ordered = sorted(own, key=lambda f: int(f.on.removeprefix(JOINT)))
    return f"{group_text(own)}: {', '.join(f'{f.on} {format_value(f.value, f.std, *unit)}' for f in ordered)}"
