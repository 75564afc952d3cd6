"""A declaration that cannot work is refused where it is made, by the names of its class and its field."""

from dataclasses import KW_ONLY, dataclass, make_dataclass
from typing import Annotated

import pytest

from planner.common.calls import Call, Option, ProgressKeyword, call_fields, check_call
from planner.common.commands import extension_commands, register_call, register_command
from planner.common.errors import DeclarationError
from planner.common.progress import no_progress


def declared(**names):
    """A declaration with one field beside the progress."""

    @dataclass(frozen=True)
    class DigCall(Call):
        """Dig."""

        _: KW_ONLY
        depth_mm: Annotated[float, Option("how deep", min=1, max=9)] = 2.0
        progress: ProgressKeyword = no_progress

    for name, value in ({"verb": "dig", "line": "Dig.", "function": "dig:dig"} | names).items():
        setattr(DigCall, name, value)
    return DigCall


@pytest.mark.parametrize(("default", "fault"), [(0.0, "the least is 1"), (9.5, "the largest is 9")])
def test_a_default_outside_its_own_bounds(default, fault):
    kind = Annotated[float | None, Option("how deep", min=1, max=9)]
    with pytest.raises(DeclarationError, match=rf"^\S+: Options\.depth_mm: its default is {default}, but {fault}"):
        call_fields(make_dataclass("Options", [("depth_mm", kind, default)]))
    (field,) = call_fields(make_dataclass("Options", [("depth_mm", kind, None)]))
    assert field.default is None


@pytest.mark.parametrize("kind", [float, "float", Annotated[float, "how deep"]])
def test_a_field_without_an_option(kind):
    with pytest.raises(DeclarationError, match=r"^\S+: Options\.depth_mm: its type has no Option: Annotated\["):
        call_fields(make_dataclass("Options", [("depth_mm", kind, 0.0)]))


def test_a_field_is_named_by_the_class_that_has_it():
    plain = make_dataclass("Options", [("depth_mm", float, 0.0)])
    with pytest.raises(DeclarationError, match=r"^\S+: Options\.depth_mm: its type has no Option"):
        call_fields(make_dataclass("OptionsAndMore", [], bases=(plain,)))


def test_a_command_without_progress_is_told_to_have_it():
    @dataclass(frozen=True)
    class Bare(Call):
        """Dig."""

        verb = "dig-bare"
        line = "Dig."
        function = "dig:dig"

    with pytest.raises(
        DeclarationError, match=r"Bare has no field progress.*'progress: ProgressKeyword = no_progress'"
    ):
        register_call(Bare)
    assert "dig-bare" not in extension_commands()


def test_headings_and_names():
    with pytest.raises(
        DeclarationError, match=r"group = 'Plam' is no heading; did you mean \"Plan\"\? \(allowed: Plan, "
    ):
        register_call(declared(group="Plam"))
    with pytest.raises(DeclarationError, match="command 'dig': group = 'x' is no heading"):
        register_command("dig", "Dig.", "dig:dig", group="x")
    with pytest.raises(DeclarationError, match='DigCall: line = "…" is missing'):
        register_call(declared(line=None))
    with pytest.raises(DeclarationError, match="DigCall: function = 'dig': 'module:name' is needed"):
        register_call(declared(function="dig"))
    assert "dig" not in extension_commands()
    check_call(declared())
