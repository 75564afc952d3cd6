"""Effects of the catalogue that a simulated robot is to show."""

from dataclasses import dataclass
from pathlib import Path

from planner.catalogue import Entry, catalogue
from planner.errors import InputError, nearest
from planner.model import Parameter
from planner.rig import Rig
from planner.robot.additions import si_unit
from planner.run import Samples
from planner.schema import Strict


class EffectFile(Strict):
    """``[[effects]]``: a kind of the catalogue, on what it acts, its value (several where it has several parameters).

    ``inner`` is the number inside, for instance a frequency, in the catalogue's unit of it.
    """

    kind: str
    on: str | None = None
    value: float | tuple[float, ...]
    unit: str
    inner: float | None = None


@dataclass(frozen=True)
class Effect:
    """Parameters of one effect with their values in SI units; ``said`` as the file says it."""

    parameters: tuple[Parameter, ...]
    values: tuple[float, ...]
    said: str


def effects_of(path: Path, files: tuple[EffectFile, ...], rig: Rig, samples: Samples) -> tuple[Effect, ...]:
    """Return the effects that the file asks for.

    Raises:
        InputError: a kind that the catalogue does not have, or this run cannot show; a value or unit that does not fit.
    """
    if not files:
        return ()
    entries = catalogue(rig, samples)
    return tuple(_effect(f"{path}: [[effects]] number {k}", f, entries) for k, f in enumerate(files, start=1))


def _effect(where: str, file: EffectFile, entries: tuple[Entry, ...]) -> Effect:
    entry = _entry(where, file, entries)
    if (file.inner is None) != (entry.inner is None):
        wanted = "takes no 'inner'" if entry.inner is None else f"needs 'inner', its {entry.inner.name}"
        unit = "" if entry.inner is None else f" [{entry.inner.unit}]"
        raise InputError(f"{where}: {entry.name} {wanted}{unit}")
    parameters = entry.make(file.inner)
    values = file.value if isinstance(file.value, tuple) else (file.value,)
    if len(values) > len(parameters) or (len(values) < len(parameters) and isinstance(file.value, tuple)):
        names = ", ".join(p.name for p in parameters)
        raise InputError(f"{where}: {len(values)} values found, {entry.name} has {len(parameters)} ({names})")
    values += (0.0,) * (len(parameters) - len(values))
    factor = _factor(where, file.unit, parameters[0].unit)
    inner = "" if file.inner is None else f", inner = {file.inner:g}"
    said = f'{{kind = "{entry.kind}", on = "{entry.on}", value = {file.value}, unit = "{file.unit}"{inner}}}'
    return Effect(parameters, tuple(v * factor for v in values), said.replace("(", "[").replace(")", "]"))


def _entry(where: str, file: EffectFile, entries: tuple[Entry, ...]) -> Entry:
    of_kind = [e for e in entries if e.kind == file.kind]
    if not of_kind:
        known = list(dict.fromkeys(e.kind for e in entries))
        raise InputError(
            f"{where}: kind = '{file.kind}' is no effect that this run could show{nearest(file.kind, known)} "
            f"(there are: {', '.join(known)})"
        )
    there = [e.on for e in of_kind]
    if file.on is None and len(of_kind) > 1:
        raise InputError(f"{where}: the key 'on' is missing; {file.kind} may act on {', '.join(there)}")
    if file.on is not None and file.on not in there:
        raise InputError(f"{where}: on = '{file.on}'{nearest(file.on, there)} ({file.kind} acts on {', '.join(there)})")
    return of_kind[0 if file.on is None else there.index(file.on)]


def _factor(where: str, unit: str, wanted: str) -> float:
    try:
        si, factor = si_unit(unit)
    except ValueError as err:
        raise InputError(f"{where}: unit = '{unit}': {err}") from err
    if si != wanted:
        raise InputError(f"{where}: unit = '{unit}' is {si}, but a value in {wanted} is needed")
    return factor
