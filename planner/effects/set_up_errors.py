"""What the cell holds for known of its set-up and may have wrong: where fixtures stand, the tool point, a bar's zero.

What a cell frees is in every model, and so is what it holds for known but states no better than readings show. What is
stated better than that is sought like any other cause: what is off there would else be named as something that it is
not.
"""

from collections.abc import Iterator
from dataclasses import replace

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import FREEABLE
from planner.common.units import DEG, MM
from planner.effects.catalogue import Background, Excitation, register
from planner.effects.effect import Effect, Parameter, Place, Role
from planner.effects.gauge_unknowns import unknowns_of
from planner.effects.sizes import SET_UP_LARGEST

STATED = "stated by the cell file; more than this is another place"
# [m, rad] one sigma of a statement that is wrong, whatever it states: as large as what nobody has measured
USUAL = {"fixture": 5 * MM, "map": 1 * MM, "zero": 1 * MM, "probe": 0.1 * DEG}
KINDS = {"fixture": "fixture place", "map": "tool place", "probe": "tool place", "zero": "gauge zero"}


def set_up_parts(setup: MeasurementSetup) -> dict[str, list[Parameter]]:
    """Return all parameters of the gauge that may be free, grouped by what they belong to (a fixture, a zero)."""
    parts: dict[str, list[Parameter]] = {}
    for p in unknowns_of(setup.gauge).parameters(setup, FREEABLE):
        parts.setdefault(p.name if p.main_move.on == "reading" else p.name.rpartition("_")[0], []).append(p)
    return parts


@register(*dict.fromkeys(KINDS.values()), needs="a cell that does not free it", background=Background.NAMED_ONLY)
def set_up_errors(run: Excitation) -> Iterator[Effect]:
    """Yield an effect for each thing of the set-up that is not free; it has the parameters by which it would be."""
    free = {p.name for p in unknowns_of(run.setup.gauge).parameters(run.setup, FREEABLE - run.setup.fixed)}
    for label, own in set_up_parts(run.setup).items():
        thing, _, name = label.partition("_")
        if thing in KINDS and not free & {p.name for p in own}:
            place, sentence = _words(thing, name)
            wrong = tuple(replace(p, prior=max(p.prior, USUAL[thing])) for p in own)
            yield Effect(KINDS[thing], Place(place), wrong, sentence, SET_UP_LARGEST, STATED, role=Role.SET_UP)


def _words(thing: str, name: str) -> tuple[str, str]:
    """Return place and sentence of a thing, ``map``, and its name, empty where there is but one."""
    if thing == "fixture":
        which = f"fixture {name}" if name else "the fixture"
        return (
            which,
            f'{which} stands {{size}} from where the cell has it (free it: plan.free = ["fixture"])',
        )
    if thing == "zero":
        which = f"{name} gauge".strip()
        return (
            which,
            f'the zero of the {which} is off, it reads {{size}} {{more}} (free it: gauge.zero = "free")',
        )
    if thing == "probe":
        return "probe", "the probe is turned by {size} from how the cell has it on the flange"
    which = f"tool point {name}".strip()
    return (
        which,
        f'{which} sits {{size}} from where the cell has it (free it: plan.free = ["tool"])',
    )
