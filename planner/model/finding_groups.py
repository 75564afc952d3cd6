"""Findings of one kind as the one thing that they are: a reflector that was seated anew, play in joint after joint.

They are draws of one random effect: its size each time, or at each joint, has a root mean square, which n of them tell
within 1 / √(2 n) of itself.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.common.units import MM, display_unit, format_value
from planner.effects.nonparametric import NONPARAMETRIC
from planner.model.beside_findings import ManyOfOneKind
from planner.model.identification_document import Finding

JOINT = "joint "


@dataclass(frozen=True)
class FindingGroup:
    """Findings that are said together.

    Attributes:
        findings: one, or MANY and more of one kind, in the order in which they were found.
        note: sentence about all of them.
        rivals: other effects that explain the same as one of them.
    """

    findings: tuple[Finding, ...]
    note: str
    rivals: tuple[str, ...]

    @property
    def probability(self) -> float | None:
        """Probability of the least certain finding; ``None`` where no posterior was drawn."""
        known = [f.probability for f in self.findings if f.probability is not None]
        return min(known) if known else None

    @property
    def is_doubtful(self) -> bool:
        """Whether another cause, or none, is likelier than the most certain of them."""
        return all(_is_doubtful(f) for f in self.findings)

    @property
    def grade(self) -> Literal["found", "likely", "doubtful"]:
        """What they are called: found where that is asserted of all of them, likely below, and doubtful."""
        if self.is_doubtful:
            return "doubtful"
        asserted = 0.9  # probability from which on a cause is asserted; the others are likely
        return "found" if self.probability is None or self.probability >= asserted else "likely"

    @property
    def rival_texts(self) -> tuple[str, ...]:
        """Rivals in words, the likeliest first, with their probabilities where these are known."""
        chance = dict[str, float]()
        for f in self.findings:
            chance |= dict(zip(f.rivals, f.rival_probabilities or (), strict=False))
        return tuple(cause_text(r) + (f" ({percent(chance[r])})" if r in chance else "") for r in self.rivals)

    @property
    def title(self) -> str:
        """Effect and place, and how often it was found."""
        first = self.findings[0]
        if len(self.findings) == 1:
            return f"{first.effect}, {first.on}"
        if first.after_sample is not None:
            return f"{first.effect}, {first.on}, {len(self.findings)} times"
        return f"{first.effect}, {len(self.findings)} joints"

    @property
    def common_size(self) -> tuple[float, float]:
        """Root mean square of their sizes, in SI units, and its standard deviation."""
        value, std = np.array([f.value for f in self.findings]), np.array([f.std for f in self.findings])
        size = float(np.sqrt(max(float((value**2 - std**2).mean()), float((std**2).mean()))))
        return size, size / float(np.sqrt(2 * len(value)))

    @property
    def gain(self) -> float:
        """Largest of the falls of the rms error on held-out samples [m]."""
        return max(f.gain for f in self.findings)


def many_of_one_kind(findings: Sequence[Finding]) -> tuple[ManyOfOneKind, ...] | None:
    """Return what the document says of findings that are one thing together; ``None`` where all stand alone."""
    place = {id(f): k for k, f in enumerate(findings)}
    out = []
    for group in group_findings(findings):
        if len(group.findings) > 1:
            first, (value, std) = group.findings[0], group.common_size
            on = first.on if first.after_sample is not None else "joints"
            at = tuple(place[id(f)] for f in group.findings)
            out.append(
                ManyOfOneKind(
                    effect=first.effect,
                    on=on,
                    value=value,
                    std=std,
                    unit=first.unit,
                    findings=at,
                    probability=group.probability,
                    note=group.note,
                )
            )
    return tuple(out) or None


def cause_text(name: str) -> str:
    """Return a cause in words: by its name in the catalogue, else by its place and the quantity that drives it."""
    kind, _, place = name.partition(", ")
    return f"a cause without a name ({place})" if kind == NONPARAMETRIC else name


def percent(probability: float) -> str:
    """Write a probability in whole percent; none that is not certain is called so."""
    if 0.0 < probability < 1.0:
        return f"{min(max(100 * probability, 1.0), 99.0):.0f} %"
    return f"{100 * probability:.0f} %"


def group_findings(findings: Iterable[Finding]) -> tuple[FindingGroup, ...]:
    """Return the findings, many of one kind as one, each group in the place of its first member."""
    kinds: dict[tuple[str, ...], list[Finding]] = {}
    for k, f in enumerate(findings):
        kinds.setdefault(_kind_of(f) or (str(k),), []).append(f)
    return tuple(group for own in kinds.values() for group in _groups_of(own))


def rank_groups(findings: Iterable[Finding]) -> list[FindingGroup]:
    """Return the findings as they are told: those that are surer than not first, among them those that bring most."""
    return sorted(group_findings(findings), key=lambda g: (g.is_doubtful, -g.gain))


def _kind_of(f: Finding) -> tuple[str, ...] | None:
    """What a finding has in common with others of its kind, doubt included; ``None`` where it stands alone."""
    doubt = "doubtful" if _is_doubtful(f) else ""  # one doubtful joint makes no doubt of five that are certain
    if f.after_sample is not None:
        return f.effect, f.on, f.unit, doubt
    is_one_joint = f.on.removeprefix(JOINT).isdigit() and f.inner is None and f.row is None
    return (f.effect, JOINT, f.unit, doubt) if is_one_joint else None


def _is_doubtful(f: Finding) -> bool:
    even_chance = 0.5  # probability below which another cause, or none, is likelier
    return f.probability is not None and f.probability < even_chance


def _groups_of(own: Sequence[Finding]) -> Iterator[FindingGroup]:
    if len(own) < 3:  # findings of one kind from which on they are said in one sentence
        yield from (FindingGroup((f,), f.note, f.rivals) for f in own)
        return
    rivals = dict.fromkeys(r for f in own for r in f.rivals if not r.startswith(f"{own[0].effect}, "))
    group = FindingGroup(tuple(own), "", tuple(rivals))
    note = _steps_note(group) if own[0].after_sample is not None else _joints_note(group)
    yield replace(group, note=note)


def unit_of_change(unit: str, size: float) -> tuple[str, float]:
    """Return how what changed by about ``size`` in the SI ``unit`` is written, and the factor to it."""
    # 1e-4: [m] from which on what changed is said in millimetres
    return ("mm", 1 / MM) if unit == "m" and abs(size) > 1e-4 else display_unit(unit, size)


def _steps_note(group: FindingGroup) -> str:
    """Say how often something changed, by how much each time, and when."""
    own, (each, std) = group.findings, group.common_size
    size = format_value(each, std, *unit_of_change(own[0].unit, each))
    when = ", ".join(str(k) for k in sorted(f.after_sample or 0 for f in own))
    return f"{own[0].on}: changed {len(own)} times, by {size} each (root mean square), after samples {when}"


def _joints_note(group: FindingGroup) -> str:
    """Say the size that the joints have in the mean, and that of each."""
    own, (each, std) = group.findings, group.common_size
    unit = display_unit(own[0].unit, max(abs(f.value) for f in own))
    ordered = sorted(own, key=lambda f: int(f.on.removeprefix(JOINT)))
    sizes = ", ".join(f"{f.on.removeprefix(JOINT)}: {format_value(f.value, f.std, *unit)}" for f in ordered)
    mean = format_value(each, std, *unit)
    return f"{own[0].effect} of {len(own)} joints, {mean} each (root mean square; {sizes})"
