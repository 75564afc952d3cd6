"""The languages that indicators speak; another one is one small file here and its line in ``PROTOCOLS``."""

from planner.centring.protocols.language import Language, Refused
from planner.centring.protocols.mitutoyo import Mitutoyo
from planner.centring.protocols.sylvac import Sylvac
from planner.errors import InputError, nearest

PROTOCOLS: dict[str, Language] = {"sylvac": Sylvac(), "mitutoyo": Mitutoyo()}

__all__ = ["PROTOCOLS", "Language", "Refused", "protocol"]


def protocol(name: str) -> Language:
    """Return the language called ``name``.

    Raises:
        InputError: there is no such one.
    """
    if name not in PROTOCOLS:
        known = sorted(PROTOCOLS)
        raise InputError(f"no indicator protocol '{name}'{nearest(name, known)} (there are: {', '.join(known)})")
    return PROTOCOLS[name]
