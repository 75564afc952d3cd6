"""Small controllers that run programs with an operator at the override, each written from its language alone.

A controller knows how fast a motion is driven as a share of what the machine can: the program's own words, times the
override of the operator where it is switched on. A program that writes the override, or switches it off, changes that.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import prod


@dataclass(frozen=True)
class Language:
    """How one language says its speeds and reaches the operator's override; all are patterns of one statement.

    Attributes:
        motion: a motion; its groups are speeds said with it, ``t...`` are times.
        modal: words that hold until they are said anew, by their pattern, with the value that holds before.
        of_circle: names of modal words that only circles heed, and which of the others they do not.
        knob: a statement that sets the override, its value in ``value`` (a number, or an expression of variables).
        off, on: statements that switch the override off and on.
        forbidden: whatever reaches the operator's override, by the manual named beside.
    """

    motion: str
    modal: dict[str, float] = field(default_factory=dict)
    of_circle: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    circle: str = "$^"
    knob: str = "$^"
    off: str = "$^"
    on: str = "$^"
    comment: str = r";[^\r\n]*"
    forbidden: str = "$^"
    statement: str = "\n"


@dataclass(frozen=True)
class DialectFacts:
    """What the maker's manuals say of one dialect.

    Attributes:
        given_back: what a program may change, as the controller gives it back, or it is the program's own.
        stop, wait: a line by which a program stops until a key is pressed, or waits for input 7; none in a list.
        shown: what the pendant, or the line above the stop, says at the third pose.
        targets: number of the file, from 0, that holds the positions.
    """

    given_back: str = ""
    stop: str = ""
    wait: str = ""
    shown: str = ""
    targets: int = 0


NUMBER = r"(\d+(?:\.\d+)?)"


@dataclass
class Run:
    """What a controller has driven: share of the full speed of every motion, and before which statement each stood."""

    speeds: list[float] = field(default_factory=list)
    statements: list[int] = field(default_factory=list)


def statements_of(language: Language, text: str) -> list[str]:
    """Cut a program into its statements, without remarks."""
    bare = re.sub(language.comment, "", text)
    bare = re.sub(r"(ADVANCE|WITH [^\r\n]*|,)\r?\n\s*(?=WITH)", r"\1 ", bare)
    return [s for part in bare.split(language.statement) if (s := " ".join(part.split()))]


def run_program(
    language: Language, text: str, turn_at: int | None = None, turned_to: float = 100.0, switched_on: bool = True
) -> Run:
    """Run a program whose operator turns the override to ``turned_to`` [%] before statement ``turn_at``."""
    modal, variables = dict(language.modal), {"knob": 100.0}
    out = Run()
    for number, said in enumerate(statements_of(language, text)):
        if number == turn_at:
            variables["knob"] = turned_to
        if re.fullmatch(language.off, said):
            switched_on = False
        elif re.fullmatch(language.on, said):
            switched_on = True
        elif match := re.fullmatch(language.knob, said):
            variables["knob"] = _value(match["value"], variables)
        elif match := re.fullmatch(r"(\w+)=(\$OV_PRO|[\w(*+)/]+)", said):
            variables[match[1]] = _value(match[2], variables)
        for pattern in modal:
            if match := re.fullmatch(pattern, said):
                modal[pattern] = float(match[1])
        if re.fullmatch(language.motion, said):
            factor = variables["knob"] / 100.0 if switched_on else 1.0
            out.speeds.append(prod(_said(language, said, modal)) * factor)
            out.statements.append(number)
    return out


def _said(language: Language, said: str, modal: dict[str, float]) -> Iterator[float]:
    """Yield the factors that the program's words multiply the speed of one motion with."""
    round_words, straight_words = language.of_circle
    unheeded = straight_words if re.fullmatch(language.circle, said) else round_words
    yield from (value for pattern, value in modal.items() if pattern not in unheeded)
    match = re.fullmatch(language.motion, said)
    assert match is not None
    for name, value in match.groupdict().items():
        if value is not None:
            yield 1.0 / float(value) if name == "t" else float(value)
    yield from (float(v) for v in re.findall(r"\$(?:PROG_SPD_OVR|ARM_SPD_OVR|LIN_SPD) = ([\d.]+)", said))


def _value(expression: str, variables: dict[str, float]) -> float:
    """Return a number, a variable, or an expression of whole numbers."""
    text = expression.replace("$OV_PRO", "knob").replace("/", "//")
    try:
        return float(eval(text, {"__builtins__": {}}, {k: int(v) for k, v in variables.items()}))
    except (NameError, SyntaxError):
        return 0.0
