"""Keys of basis functions: each is read back, each wrong one is named with what is allowed."""

import pkgutil
from importlib import import_module

import pytest

import planner.effects.basis as basis
from planner import effects as effects
from planner import gauges as gauges
from planner.common.errors import InputError
from planner.effects.free_laws import LegendreOf
from planner.effects.phi_keys import is_static, key_patterns, needs_loads, phi_from_key
from planner.gauges import vision as vision

ROOMS = (("planner.effects", effects), ("planner.gauges", gauges), ("planner.gauges.vision", vision))
MODULES = [import_module(f"{name}.{m.name}") for name, room in ROOMS for m in pkgutil.iter_modules(room.__path__)]


def basis_functions():
    """Those of effects and gauges that files can name; a law without a name is compared with, and never written."""
    classes = {c for m in MODULES for c in vars(m).values() if isinstance(c, type) and c.__module__ == m.__name__}
    return {c for c in classes if hasattr(c, "key") and "__call__" in vars(c)} - {basis.BasisFunction, LegendreOf}


EXAMPLE = {"JOINT": "2", "LINK": "7", "STATION": "3", "AXIS": "1", "PART": "4", "INDEX": "1"}
WORDS = {"(sin|cos)": ("sin", "cos"), "bar-(fixture|tool)": ("bar-fixture", "bar-tool"),
         "scale-(sin|cos)": ("scale-sin", "scale-cos"), "bounded-(sin|cos)": ("bounded-sin", "bounded-cos"),
         "lean-(sin|cos)": ("lean-sin", "lean-cos"), "load-(above|below)": ("load-above", "load-below"),
         "place-(tool|flange)": ("place-tool", "place-flange"),
         "ball-shape-(fixture|tool)": ("ball-shape-fixture", "ball-shape-tool")}  # fmt: skip


def example_of(kind, place):
    """A value of a kind; a number that stands further on is larger, as the end of a travel is."""
    return f"{place}.5" if kind == "NUMBER" else ({"PHI": "moment:2:0"} | EXAMPLE)[kind]


KEYS = [
    ":".join([word, *(example_of(kind, place) for place, kind in enumerate(kinds, 1))])
    for first, *kinds in (pattern.split(":") for pattern in key_patterns())
    for word in WORDS.get(first, (first,))
]


@pytest.mark.parametrize("key", [*KEYS, "times:-2e-05:twist:0:1:2:sin:6:12.25"])
def test_a_key_is_read_back(key):
    assert phi_from_key(key, 6).key == key
    assert phi_from_key(phi_from_key(key, 6).key) == phi_from_key(key, 6)


def test_every_basis_function_has_a_key_that_is_known():
    assert {type(phi_from_key(k)) for k in KEYS} == basis_functions()


def test_what_is_in_another_key_counts():
    assert not is_static("times:2.0:warmth:21.5")
    assert needs_loads("twist:2:0:0:moment:2:0")
    assert not needs_loads("twist:2:0:0:sin:2:1.0")


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("torqe:2", 'did you mean "torque"'),
        ("torque", "must read torque:JOINT"),
        ("torque:7", "from 1 to 6"),
        ("weight:2:8", "from 1 to 7"),
        ("sin:2:fast", "a number belongs"),
        ("sin:2:inf", "a number belongs"),
        ("guide:1:1:0.5:0.5", "ends before it begins"),
        ("times:2.0", "must read times:NUMBER:PHI"),
        ("times:2.0:torqe:2", 'did you mean "torque"'),
        ("moment:2:3", "from 0 to 2"),
        ("torque:0", "from 1 to 6"),
        ("torque:-1", "from 1 to 6"),
        ("place:x", "0, 1, 2"),
        ("torque:2:3", "must read"),
    ],
)
def test_a_wrong_key_says_what_is_allowed(key, words):
    with pytest.raises(InputError, match=words):
        phi_from_key(key, 6)
