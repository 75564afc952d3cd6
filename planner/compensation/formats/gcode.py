"""G-code whose axis words are the robot's joints (``A1=10.5`` or ``X10.5``), one block a line.

The words are modal: a block that leaves an axis out keeps its angle. The corrected angles of all axes differ from
block to block, so every block is written with all of them.
"""

import re
from collections.abc import Sequence

import numpy as np

from planner.common.units import DEG, read_only
from planner.compensation.formats.gcode_calls import NO_OFFSET, SAID_AGAIN, CallsElsewhere
from planner.compensation.targets import DEG_DECIMALS, Target, TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import known_statements
from planner.programs.languages.gcode import Block, parse
from planner.programs.languages.statements import Lines, PlacedNumber, Slot

_MOTION_WORDS = {"G0", "G1", "G2", "G3", "G5", "G33", "G100", "G101", "G102", "G103"}
_BESIDE = {
    "G4", "G9", "G53", "G153", "G60", "G61", "G61.1", "G64", "G90", "G93", "G94", "G95", "G641", "G642", "G126", "G161",
}  # fmt: skip
_OFFSETS = {f"G5{k}" for k in range(4, 10)} | {"G59.1", "G59.2", "G59.3"}
_HARMLESS = _BESIDE | _MOTION_WORDS | {  # they neither move an axis nor change what its angle means
    "G8", "G17", "G18", "G19", "G21", "G40", "G49", "G71", "G80", "G90.1", "G91.1", "G92.1", "G97", "G450", "G451",
    "G460", "G500", "G601", "G602", "G603", "G643", "G644", "G645", "G710",
}  # fmt: skip
_SWITCHES = {"M0", "M1", "M2", "M3", "M4", "M5", "M7", "M8", "M9", "M17", "M30", *(f"M{k}" for k in range(62, 69))}
_CARTESIAN = set("XYZABCUVWIJKE")  # and E, with which an exponent would begin
_REFUSED = {"G20": "inches", "G70": "inches", "G700": "inches", "G91": "relative angles", "G162": "relative angles"}
_SWITCHED = {"linuxcnc": {f"M{k}" for k in (128, 129, 130, 428, 429, 430)}}  # that change what axis words mean
_OFFSET_OFF = {"sinumerik": re.compile(r"\bG(?:500|53|153)\b|\bSUPA\b", re.IGNORECASE)}
_UNKNOWN = "found: what it does to the axes is not known here"
_SUB_ENDS = re.compile(r"M0?17|M99\b.*|RET\b.*|O\S+\s+ENDSUB\b.*")  # of a subprogram
_SUB_BEGINS = re.compile(r"PROC\b.*|O\S+\s+SUB\b.*")
_ENDS = {"M2", "M30", "M17", "M99"}  # of a program: the next one in the file begins anew


def read(text: str, dialect: Dialect, reading: TargetReading) -> None:
    """Note the target of every block, and refuse blocks that move in a way that is not known."""
    blocks, jumps = list(parse(text, dialect)), _jumps_to_blocks(text)
    targets = _GcodeTargets(dialect, reading, CallsElsewhere(blocks, jumps))
    within = _lines_of_subprograms(blocks, reading.name)
    declarations = (b.text for b in blocks if b.text.startswith("DEF "))
    targets.variables = {name for text in declarations for name in re.findall(r"[A-Z_]\w*", text)}
    begins = [n for n, _, row in Lines.of(text) if row.lstrip("\ufeff \t").startswith("%")][::-1]
    for block in blocks:
        if begins and block.line >= begins[-1]:  # another program of the same file
            while begins and begins[-1] <= block.line:
                begins.pop()
            targets.begin_program()
        if jumps:  # any block may be come to from anywhere
            targets.forget()
        targets.take(block, block.line in within)
    targets.note_assumptions(text, blocks)
    targets.refuse_behind_calls()


class _GcodeTargets:
    """The modal state, as far as it decides what an axis word means."""

    def __init__(self, dialect: Dialect, reading: TargetReading, calls: CallsElsewhere) -> None:
        self.reading, self.calls = reading, calls
        self.equals = dialect.axes[0].endswith("=")
        self.axes = [axis.rstrip("=").upper() for axis in dialect.axes]
        self.joints = self.axes[: len(reading.axes)]
        reads = dialect.reading
        self.motion = reads.motion
        self.ahead_first = tuple(name for name in self.joints if name in dialect.speed.approach_first)
        self.ahead: Block | None = None  # that drives but the axes that go first
        self.work_offset = "G53" if "X" in self.axes else ""
        self._own = known_statements(dialect, lambda texts: (b for text in texts for b in parse(text, dialect)), None)
        self._said = [p for p in (reads.dwell, reads.exact, reads.blended, reads.sync, reads.pulse_end) if p]
        self.name = dialect.name
        self.variables: set[str] = set()  # that the program declares
        self.begin_program()

    def begin_program(self) -> None:
        """Begin with what a controller holds before a program: nothing is known of the modal state."""
        self.mode, self.offset, self.called, self.said = "", "", 0, set[str]()  # words that a subprogram has said
        self.is_sub = False
        self.calls.end_program()
        self.forget()

    def note_assumptions(self, text: str, blocks: Sequence[Block]) -> None:
        """Note what the words of the axes are taken to be."""
        if not blocks:
            return
        if self.work_offset:
            said = f"{' '.join(self.joints)} are taken as joint angles (trivial kinematics), not as a place"
            self.reading.notes.append((blocks[0].line, said))
        off = _OFFSET_OFF.get(self.name)
        if off is not None and not off.search(text):
            self.reading.notes.append((blocks[0].line, "no G500, G53 or G153: the work offset is taken as zero"))

    def refuse_behind_calls(self) -> None:
        """Refuse moves behind what another program may have changed, unless every move has to say G53 anyhow."""
        self.calls.end_program()
        self._refuse_ahead()
        for line, why in () if self.work_offset else self.calls.uncertain_moves():
            self.reading.refuse(line, why)

    def forget(self) -> None:
        """Forget where the axes stand: what comes next may be driven from anywhere."""
        self.last: list[float | None] = [None] * len(self.joints)
        self._refuse_ahead()

    def _refuse_ahead(self) -> None:
        """Refuse the block of axes that go first, where no block with all of them has come."""
        if self.ahead is not None:
            block, self.ahead = self.ahead, None
            unknown = [name for name in self.joints if name not in self.ahead_first]
            self.reading.refuse(block.line, _unknown_sentence(unknown))

    def _goes_ahead(self, block: Block, given: dict[str, PlacedNumber]) -> bool:
        """Take in a block, and return whether it drives but the axes that go first, from wherever the arm stands.

        The next one has to lead all axes to the same place.
        """
        if self.ahead is None:
            if any(angle is not None for angle in self.last) or set(given) != set(self.ahead_first) or not given:
                return False
            self.ahead = block
            return True
        before = {name: number.value for name, number in self.ahead.words or () if name in self.ahead_first}
        same = all(name in given and given[name].value == angle for name, angle in before.items())
        if not same or set(given) != set(self.joints):
            self._refuse_ahead()
        return False

    def take(self, block: Block, in_subprogram: bool) -> None:
        """Process one block of the program."""
        if in_subprogram and _SUB_BEGINS.fullmatch(block.text):
            self.begin_program()
        self.is_sub = in_subprogram
        self.calls.note_modal_words(block)
        self.calls.branch(block)
        if not block.optional:  # or the operator may have it left out
            self.said |= SAID_AGAIN.intersection([*block.codes, block.text])
        if not (self._own(block) or any(re.fullmatch(p, block.text) for p in self._said)):
            if block.words is None or ("=" in block.text and not self.equals):
                self._statement(block)
            else:
                self._take_words(block, block.words)
        if _functions(block) & _ENDS:
            self.begin_program()

    def _take_words(self, block: Block, found: Sequence[tuple[str, PlacedNumber]]) -> None:
        for code in block.codes:
            if code in _REFUSED:
                self.reading.refuse(block.line, _unit_sentence(code))
            self.mode = code if code in _MOTION_WORDS else self.mode
            self.offset = code if code in _OFFSETS else self.offset
        if tool := self._tool_offset(block):
            sentence = f"{tool} found: a tool offset or a group of offsets, whose lengths are not known here"
            self.reading.refuse(block.line, sentence)
        if foreign := [name for name, _ in found if name in _CARTESIAN and name not in self.axes]:
            sentence = f"the word {foreign[0]} found; the robot's axes are {' '.join(self.joints)} in this dialect"
            self.reading.refuse(block.line, sentence)
        elif odd := self._unknown_word(block):
            self.reading.refuse(block.line, f"the word {odd} found, which is not known here: it may move an axis")
        elif words := [word for word in found if word[0] in self.axes]:
            self._move(block, words)
        else:
            self._check_codes(block)
        self._take_functions(block, {name for name, _ in found})

    def _take_functions(self, block: Block, names: set[str]) -> None:
        """Note what else the words of a block may do: calls, functions of the PLC, other kinematics."""
        functions, stays = _functions(block), self._stays(block)
        if switched := sorted(functions & _SWITCHED.get(self.name, set())):
            self.reading.refuse(block.line, f"{switched[0]} found: it changes what the words of the axes mean")
        elif not functions <= _SWITCHES or (not stays and {"L", "P"} & names):
            self.called = block.line
        if "M98" in functions or (not stays and {"L", "P"} & names):
            self.calls.call(block)
        if block.optional or not stays:
            self.forget()

    def _tool_offset(self, block: Block) -> str:
        """Return the word of a block that adds a tool or a group of offsets to axes, or nothing."""
        words = [(name, number) for name, number in block.words or () if number.value]
        return next((f"{n}{v.text}" for n, v in words if re.fullmatch(r"D|TOFFL?R?|TCARR|G\d+", n)), "")

    def _unknown_word(self, block: Block) -> str:
        """Return a word that may be an axis: any other beside a motion, or one that looks like an axis; or nothing."""
        moves = any(code in _MOTION_WORDS for code in block.codes)
        for name, _ in block.words or ():
            known = name in self.axes or name in self.variables or _KNOWN_WORD.fullmatch(name)
            if not known and (moves or _LIKE_AN_AXIS.fullmatch(name)):
                return name
        return ""

    def _check_codes(self, block: Block) -> None:
        """Refuse G words without axes that may move one, or shift what its angle means."""
        harmless = _HARMLESS | set(_REFUSED) | (_OFFSETS if self.work_offset else set())
        for code in block.codes:
            if code in _OFFSETS - harmless:
                self.reading.refuse(block.line, f"{code} found: a work offset, which is not known here")
            elif code not in harmless:
                self.reading.refuse(block.line, f"{code} {_UNKNOWN}")

    def _stays(self, block: Block) -> bool:
        """Tell whether the words beside the axes leave these where they are: no call, no function of the PLC."""
        names = {name for name, _ in block.words or () if name not in self.axes and not re.fullmatch(r"R\d+", name)}
        functions = _functions(block)
        parameters = names - set("GMFSTDH")  # of a code of the block; on their own they call a program
        if "L" in parameters and "M66" not in functions:
            return False
        return functions <= _SWITCHES and (not parameters or bool(block.codes or functions))

    def _statement(self, block: Block) -> None:
        """Process a line that is no row of words and none of the dialect's own: what it does is not known."""
        if sentence := self._doubt(block):
            self.reading.refuse(block.line, sentence)
        self.forget()

    def _doubt(self, block: Block) -> str:
        """Say why a line may move an axis, or change what its angle means; nothing where it does neither."""
        said = re.sub(r'"[^"]*"|<[^<>]*>|\$\w+\[[^\[\]]*\](?!\s*=(?!=))', " ", block.text)
        edge = r"[A-Z0-9_$]" if self.equals else r"[A-Z_]"
        if axis := re.search(rf"(?<!{edge})({'|'.join(self.joints)})(?!{edge})", said):
            return f"'{block.text}' computes or moves axis {axis[1]}; axis words with plain numbers are allowed"
        if shift := _shift_in(block.text):
            return f"{shift} {_UNKNOWN}"
        if match := re.search(rf"(?<![\w.])({'|'.join(_REFUSED)})(?![\w.])", said):
            return _unit_sentence(match[1])
        if re.search(r"(?<![A-Z0-9_])G\s*\d", said):
            return f"'{block.text}' is no row of words; axis words with plain numbers are allowed"
        if calls := _calls_program(said.strip()):
            self.called = block.line
            self.calls.call(block)
        return "" if calls or _is_statement(said.strip()) else f"'{block.text[:60]}' {_UNKNOWN}"

    def _move(self, block: Block, words: list[tuple[str, PlacedNumber]]) -> None:
        if wrong := self._why_not(block, [name for name, _ in words]):
            self.reading.refuse(block.line, wrong)
            return
        self._check_subprogram(block)
        self.calls.move(block)
        if self.called:
            said = f"absolute angles without an offset are taken for granted after what line {self.called} calls"
            self.reading.notes.append((block.line, said))
            self.called = 0
        if self.work_offset and not self._take_offset(block):
            return
        given = dict(words)
        if self._goes_ahead(block, given):
            return
        after = words[-1][1].start + len(words[-1][1].text)
        slots: list[Slot] = []
        for k, name in enumerate(self.joints):
            if name in given:
                self.last[k] = given[name].value * DEG
                slots.append(given[name].slot(DEG, DEG_DECIMALS))
            else:
                slots.append(Slot(after, after, DEG, DEG_DECIMALS, prefix=f" {name}{'=' if self.equals else ''}"))
        if unknown := [name for name, angle in zip(self.joints, self.last, strict=True) if angle is None]:
            self.reading.refuse(block.line, _unknown_sentence(unknown))
            return
        before = dict(self.ahead.words or ()) if self.ahead is not None else {}
        places = [(k, before[name].slot(DEG, DEG_DECIMALS)) for k, name in enumerate(self.joints) if name in before]
        self.ahead = None
        q = read_only(np.array(self.last, dtype=float))
        self.reading.add(Target(block.line, tuple(slots), q=q, ahead=tuple(places)))

    def _check_subprogram(self, block: Block) -> None:
        """Refuse a move of a subprogram that does not say for itself what its caller may have said otherwise."""
        if not self.is_sub:
            return
        if "G90" not in self.said:
            said = (
                "a subprogram moves here, and whether G90 or G91 holds is its caller's: G90 in the subprogram says it"
            )
            self.reading.refuse(block.line, said)
        if not NO_OFFSET.intersection(block.codes) and not {"G500", "TRANS"} <= self.said:
            said = "a subprogram moves here, and frames and offsets are its caller's: G53 or G153 here leaves them out"
            self.reading.refuse(block.line, said)

    def _take_offset(self, block: Block) -> bool:
        """Note whether a block is driven without the work offset, which always is the first one or another."""
        if self.work_offset in block.codes:
            return True
        after = f" after {self.offset}" if self.offset else ""
        said = f"no {self.work_offset}{after}: the work offset is not known here, and {self.work_offset} leaves it out"
        self.reading.refuse(block.line, said)
        self.forget()  # what stands in one system has other numbers in the other
        return False

    def _why_not(self, block: Block, names: list[str]) -> str:
        """Say why a block with axis words cannot be compensated; nothing where it can."""
        allowed = rf"{self.motion}|G0"
        strange = [code for code in block.codes if code not in _BESIDE and not re.fullmatch(allowed, code)]
        if not re.fullmatch(allowed, self.mode) or strange:
            return f"'{block.text}' is no joint move; {self.motion.replace('0?', '')} and G0 are allowed"
        beside = {name for name, _ in block.words or ()} - set(self.axes)
        if odd := sorted(beside - set("GMFSTDHPR") - {"ADIS"}):
            return f"the word {odd[0]} found beside a move, which is not known here"
        for name in names:
            if name not in self.joints:
                return f"axis {name} is not one of the robot's; {' '.join(self.joints)} are allowed"
            if names.count(name) > 1:
                return f"axis {name} stands twice"
        return ""


_KNOWN_WORD = re.compile(r"[FGHMST]\d*|[DLNOPQ]|R\d*|ADIS(?:POS)?|TOFFL?R?|TCARR")
_LIKE_AN_AXIS = re.compile(r"[A-Z]{1,2}\d{0,2}")


def _lines_of_subprograms(blocks: Sequence[Block], name: str) -> set[int]:
    """Return the numbers of the lines that belong to subprograms: from a subprogram's head to its end."""
    found, begun, is_sub = set[int](), list[int](), name.lower().endswith(".spf")
    for block in blocks:
        if _SUB_BEGINS.fullmatch(block.text):
            found |= set(begun) if is_sub else set()
            begun, is_sub = [], True
        begun.append(block.line)
        ends = _SUB_ENDS.fullmatch(block.text) is not None
        if ends or _functions(block) & _ENDS:
            found |= set(begun) if is_sub or ends else set()
            begun, is_sub = [], False
    return found | (set(begun) if is_sub else set())


def _unknown_sentence(axes: list[str]) -> str:
    return (
        f"the angle of {', '.join(axes)} is not known here; the first move, and the first after a jump, must name all "
        "axes"
    )


def _unit_sentence(code: str) -> str:
    return f"{code} found ({_REFUSED[code]}); absolute angles in degrees are allowed"


def _functions(block: Block) -> set[str]:
    return {f"M{number.value:g}" for name, number in block.words or () if name == "M"}


# What a line does that is no row of words: a statement, a call, a shift of what angles mean, or unknown.
_SHIFTS = re.compile(  # words and variables that turn axis angles into something else
    r"\b(A?TRANS|A?ROTS?|A?SCALE|A?MIRROR|TRA\w+|CYCLE800|REPOS\w*|SETINT|EXECSTRING|TOFRAME\w*|TOROT\w*|PAROT|PRESETON)\b"
    r"|\$P_\w*(?:FR|FRAME)\b(?:\[[^\[\]]*\])*\s*=(?!=)|(?<![A-Z0-9_$])G\s*[=\[#(]|#52[12]\d\s*=(?!=)"
)
_VARIABLE = (
    r"(?:R\s*\d+|R\[[^\]]*\]|#\s*(?:\d+|<\w+>)|\$A_(?:OUTA?|DB[BWDR])\[[^\]]*\]"
    r"|(?!(?:IDS?|AX|POS[AP]?)\b|[A-Z]\d*\s*=)[A-Z_]\w*(?:\[[^\]]*\])?)"
)
_STATEMENTS = (  # that neither move an axis nor change what its angle means, calls in them apart
    r"(?:IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|UNTIL|CASE|GOTO\w?)\b.*",
    r"O\s*(?:\d+|<\w+>)\s*(?:(?:END)?(?:SUB|IF|WHILE|REPEAT)|RETURN|ELSE(?:IF)?|DO|BREAK|CONTINUE)\b.*",
    r"(?:DEF|EXTERN|PROC|END_PROC|LOCAL|VAR|END_VAR)\b.*",
    r"[A-Z_]\w*:",
    r"(?:MSG|WRITE|LOGOPEN|LOGAPPEND|LOGCLOSE|DEBUG|PRINT|SETAL|WAIT[ME])\s*\(.*\)?",
    r"STOPRE|STOPFIFO|STARTFIFO|RET|(?:SOFT|BRISK|DRIVE|FFW(?:ON|OF)|FNORM|FLIN|CFC|CFIN|CFTCP|DISPLO[FN]|SBLO[FN])\s*",
    rf"(?:{_VARIABLE}|[FSTM]\d?)\s*=(?!=)(?:[^=]|[<>=]=)*",
)
_STATEMENT = re.compile("|".join(_STATEMENTS))
_MATHS = "IF|WHILE|UNTIL|AND|OR|NOT|SIN|COS|TAN|ASIN|ACOS|ATAN2?|SQRT|ABS|POT|TRUNC|ROUND|EXISTS|ISVAR"
_CALLED = rf"(?!(?:{_MATHS})\b)[A-Z_]\w*"
_CALL = re.compile(
    r"[MPI]?CALL\b.*|EXTCALL\b.*|O\s*[\w\[<]*.*\bCALL\b.*"
    rf"|{_CALLED}\s*(?:\(.*\)\s*)?|[^=]*=.*\b{_CALLED}\s*\(.*"
)
_CALLS_NOTHING = re.compile(_STATEMENTS[0] + "|" + "|".join(_STATEMENTS[2:6]))
_JUMP = re.compile(r"\bGOTO[BFCS]?\b\s*(?P<target>[^;(\r\n]*)", re.IGNORECASE)
_JUMPS_TO_BLOCK = re.compile(
    r"\bM\s*97\b|\bM\s*98\b[^;\r\n]*H|\bM\s*99\b[^;\r\n]*P|\bMCALL\s+\w|\bREPEATB?\s+N?\d", re.IGNORECASE
)


def _jumps_to_blocks(text: str) -> bool:
    """Tell whether a program may go on at any of its blocks: jumps but to a label that it holds, modal calls."""
    labels = {label.upper() for label in re.findall(r"(?m)^[ \t]*(?:N\d+[ \t]*)?([A-Za-z_]\w*)[ \t]*:", text)}
    targets = (m["target"].strip().upper() for m in _JUMP.finditer(text))
    return _JUMPS_TO_BLOCK.search(text) is not None or any(target not in labels for target in targets)


def _shift_in(text: str) -> str:
    """Return the word of a line that makes axis angles mean something else, or nothing."""
    match = _SHIFTS.search(re.sub(r'"[^"]*"', " ", text))
    return match[0].strip() if match else ""


def _calls_program(text: str) -> bool:
    """Tell whether a line runs a program or a function of somebody's own."""
    return _CALL.fullmatch(text) is not None and _CALLS_NOTHING.fullmatch(text) is None


def _is_statement(text: str) -> bool:
    """Tell whether a line is known to leave the axes and the meaning of their angles alone."""
    return _STATEMENT.fullmatch(text) is not None
