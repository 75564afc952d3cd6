"""No text of a person changes what a program does, and no statement that nobody listed is released."""

import re
from dataclasses import fields, is_dataclass, replace
from functools import cache

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import tests.programs.sessions as sessions
from planner.programs.dialect import dialects, load_dialect
from planner.programs.instructions import Comment, Pause, Program, WaitInput
from planner.programs.rendering import ProgramFile
from planner.programs.verification import EXECUTIONS, ProgramMismatchError, write_program
from tests.programs.languages import facts_of
from tests.programs.reading import read_back, verify

NAMES = [d.name for d in dialects()]
STATEMENTS = {d.reading.family: facts_of(d.reading.family).REFUSED for d in dialects()}
PIECES = st.one_of(
    st.sampled_from([s for found in STATEMENTS.values() for s in found]),
    st.sampled_from(
        ["\n", "\r", "\x0b", "\x85", "\u2028", ")", "(", ";", "%", "'", '"', "\\", "!", "--", "*)", "|", "{", "}"]
    ),
    st.sampled_from(
        ["MSG,", "DEBUG,#1", "py,", "LOG,", "FOLD", "ENDFOLD", "#", "\x00", "\x1b[2J", "\u037e", "\uff08", "\uff1b"]
    ),
    st.text(max_size=8),
)
TEXT = st.lists(PIECES, max_size=8).map("".join)


def _with_text(value: object, text: str) -> object:
    """Return the value with ``text`` for every string of a person in it, however deep."""
    if isinstance(value, str):
        return text
    if isinstance(value, tuple):
        return tuple(_with_text(v, text) for v in value)
    if is_dataclass(value) and not isinstance(value, type):
        kept = ("plan_id", "changed")  # a hash, checked as such; a remark that is there or not, as test_export has it
        said = {f.name: _with_text(getattr(value, f.name), text) for f in fields(value) if f.name not in kept}
        return replace(value, **said)
    return value


def _statements(name: str, files: tuple[ProgramFile, ...]) -> list[str]:
    """Every statement of a program, as the reader takes them from it; nothing that stands in remarks or quotes."""
    dialect = load_dialect(name)
    found = EXECUTIONS[dialect.reading.family](dialect).parse(tuple(f.text for f in files))
    return [re.sub(r"\s+", " ", s.text) for s in found]


def _words(name: str, files: tuple[ProgramFile, ...]) -> list[list[str]]:
    return [re.findall(r"\w+|\W", s.lower()) for s in _statements(name, files)]


def _is_same_but_for_the_name(found: list[str], harmless: list[str], own: str) -> bool:
    """Compare the words of a statement with those of a program that is called ``a``."""
    return len(found) == len(harmless) and all(
        x == y or (x, y) == (own, "a") for x, y in zip(found, harmless, strict=True)
    )


@cache
def _harmless(name: str, kind: str) -> list[list[str]]:
    return _words(name, write_program(PROGRAMS[kind], name, "a"))


PROGRAMS: dict[str, Program] = {
    kind: replace(made, instructions=(*made.instructions, Comment("as the operator says")))
    for kind, made in (("static", sessions.static(n_poses=2)), ("continuous", sessions.continuous(n_poses=2)))
}
TRIED = [pytest.param(n, marks=pytest.mark.slow) if n == "lerobot" else n for n in NAMES]  # thousands of frames
CIRCLES = [name for name in NAMES if load_dialect(name).circle is not None]


@pytest.mark.parametrize("name", TRIED)
@settings(max_examples=12, deadline=None)
@given(text=TEXT, stem=TEXT, kind=st.sampled_from(sorted(PROGRAMS)))
@example(text="///TOOL 7", stem="", kind="continuous")
def test_no_text_changes_the_statements(name: str, text: str, stem: str, kind: str) -> None:
    hostile = _with_text(PROGRAMS[kind], text)
    assert isinstance(hostile, Program)
    files = write_program(hostile, name, stem)
    found, harmless = _words(name, files), _harmless(name, kind)
    own = files[0].name.partition(".")[0].lower()
    assert len(found) == len(harmless)
    assert all(_is_same_but_for_the_name(x, y, own) for x, y in zip(found, harmless, strict=True))
    assert all(re.fullmatch(r"\w+\.\w+", f.name) and f.text.isascii() for f in files)


@pytest.mark.parametrize(("name", "circles"), [*((n, False) for n in NAMES), *((n, True) for n in CIRCLES)])
def test_a_statement_that_nobody_listed_is_not_released(name: str, circles: bool) -> None:
    program = sessions.with_circle() if circles else sessions.continuous()
    files = write_program(program, name, "a")
    lines = files[0].text.split("\n")
    listed = ("$VEL.CP=3", "$TOOL=$NULLFRAME") if circles else ()  # of a circle, where it does no harm
    for statement in (s for s in STATEMENTS[load_dialect(name).reading.family] if s not in listed):
        for at in (len(lines) // 3, len(lines) // 2):
            text = "\n".join([*lines[:at], statement, *lines[at:]])
            with pytest.raises(ProgramMismatchError):
                verify(program, name, (replace(files[0], text=text), *files[1:]))


@pytest.mark.parametrize(("name", "statement"), [("pdl2", "MOVE TO {1, 2}"), ("krl", "PTP {A1 5}"), ("rapid", "Stop;")])
def test_a_statement_before_the_first_routine_is_not_passed_over(name: str, statement: str) -> None:
    program = sessions.static()
    first, *rest = write_program(program, name, "a")
    head, line, tail = first.text.partition("BEGIN" if name == "pdl2" else "DEF A" if name == "krl" else "PROC main")
    edited = replace(first, text=f"{head}{statement}\n{line}{tail}")
    if name != "rapid":  # a known statement at an odd place is the controller's error, no command
        with pytest.raises(ProgramMismatchError):
            verify(program, name, (edited, *rest))


def test_the_signals_of_another_cell_are_not_released() -> None:
    for name in NAMES:
        files = write_program(sessions.static(), name, "a")
        d = load_dialect(name)
        if "{output}" not in str(d.sync.rest + d.reading.passive):  # an M function, or a format without signals
            continue
        with pytest.raises(ProgramMismatchError, match=r"does not know|pulses"):
            verify(sessions.with_controller(sessions.static(), sync_output=8), name, files)
        assert read_back(name, files).unknown == ()


IN_BRACES = ("number", "what", "name", "input", "output", "map", "ID", "tool", "until")


@pytest.mark.parametrize("word", IN_BRACES)
@pytest.mark.parametrize("name", NAMES)
def test_braces_in_a_persons_words_stay_what_they_are(name, word):
    """What a person calls a fixture is printed letter by letter, whatever the dialect's own lines have in braces."""
    program, text = sessions.static(), f"VV{{{word}}}WW"
    items = [replace(i, message=text) if isinstance(i, Pause) else i for i in program.instructions]
    items = [replace(i, what=text) if isinstance(i, WaitInput) else i for i in items]
    files = write_program(replace(program, instructions=(*items, Comment(text))), name, "a")
    printed = [set(re.findall("VV(.*?)WW", f.text)) for f in files if "VV" in f.text]
    assert printed
    assert all(found == {f"{{{word}}}"} for found in printed)
