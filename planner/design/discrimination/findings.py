"""The findings of an identification, read from its file, and the names of effects that may occur in it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.effects.catalogue import check_effect_name, strip_repeat
from planner.model.finding import Member
from planner.model.identification_document import Identification


@dataclass(frozen=True)
class IdentifiedEffect:
    """A finding of the identification.

    Attributes:
        name: ``effect, on``, as the catalogue calls its entry.
        size: of the vector of its parameters, in SI units; ``inner`` its inner number, too.
        rivals: names of the entries that explain the same, the likeliest first.
    """

    name: str
    size: float
    inner: float | None
    rivals: tuple[str, ...]

    @property
    def label(self) -> str:
        """The name, with the inner number where there is one: two waves of one gear have the same name."""
        return self.name if self.inner is None else f"{self.name} ({self.inner:.4g})"


@dataclass(frozen=True)
class IdentificationResult:
    """What an identification found.

    Attributes:
        path: of the file.
        found: its findings.
        values: of the parameters that its last stage fitted, by name, in SI units: those of the findings' sizes.
        document: the file.
    """

    path: Path
    found: tuple[IdentifiedEffect, ...]
    values: dict[str, float]
    document: Identification

    def noise(self, width: int) -> float:
        """Noise [m] of one of the ``width`` numbers of a reading: the last stage's error, with what the fit took."""
        d, last = self.document, self.document.stages[-1]
        taken = np.sqrt(max(d.n_samples * width / d.correlation_time / d.degrees_of_freedom, 1.0))
        return float(min(last.train.rms * taken, last.held_out.rms) / np.sqrt(width))


def read_identification(path: Path, robot: str, n_joints: int) -> IdentificationResult:
    """Read ``identification.json`` for a plan of ``robot``, an arm of ``n_joints`` joints.

    Raises:
        InputError: no identification, one of another robot, one without rivals, or an effect that there is none of.
    """
    part = Identification.read_usable(path)
    if not min(part.stages[-1].train.rms, part.stages[-1].held_out.rms) > 0:
        raise InputError(f"{path}: 'stages' number {len(part.stages)}: 'rms_mm' must be greater than 0")
    if part.robot != robot:
        raise InputError(f"{path}: identifies the robot '{part.robot}', but the cell's is '{robot}'")
    named = [f for cause in part.findings for f in cause.each]
    if not any(f.rivals for f in named):
        what = "its findings have no rivals" if named else "it has no findings"
        raise InputError(f"{path}: there is nothing to separate, {what}: plan without --separate")
    for k, cause in enumerate(part.findings, start=1):
        for name in (n for f in (cause, *cause.each) for n in (f.name, *f.rivals)):
            check_effect_name(name, n_joints, f"{path}: 'findings' number {k}")
    return IdentificationResult(path, _one_each(named), {e.name: e.value for e in part.last_fit}, part)


def _one_each(findings: Sequence[Member]) -> tuple[IdentifiedEffect, ...]:
    """Return the findings; what stepped again and again is one, with the largest of its steps and all rivals."""
    out = dict[str, IdentifiedEffect]()
    for f in findings:
        inner = None if f.inner is None else f.inner.value
        rivals = tuple(dict.fromkeys(strip_repeat(r) for r in f.rivals))
        one = IdentifiedEffect(strip_repeat(f.name), f.value, inner, rivals)
        if (known := out.get(one.label)) is not None:
            size = max(one.size, known.size, key=abs)
            one = replace(known, size=size, rivals=tuple(dict.fromkeys((*known.rivals, *rivals))))
        out[one.label] = one
    return tuple(out.values())
