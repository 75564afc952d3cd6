"""URScript: one statement a line, blocks from ``def``, ``thread``, ``while`` or ``if`` to their ``end``."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.languages.execution import Execution

_ANGLE = rf"d2r\(({st.NUMBER})\)"
_ROUTINE = re.compile(r"(?:def|thread)\s+(\w+)\(\)\s*:")
_BLOCK = re.compile(r"(?:while|if)\b.*:")
_MOTION = re.compile(r"\b(?:(?:opti)?move[jlpc]|servo[jc]|speed[jl]|stop[jl]|force_mode|freedrive_mode|teach_mode)\b")
_JOINTS = rf"\[({_ANGLE}(?:, {_ANGLE})*)\]"
_MOVE = re.compile(rf"movej\({_JOINTS}, v=d2r\((?P<speed>{st.NUMBER})\)(?:, r=(?P<radius>{st.NUMBER}))?\)")
_CIRCLE = re.compile(rf"movec\({_JOINTS}, {_JOINTS}, v=(?P<speed>{st.NUMBER})(?:, r=(?P<radius>{st.NUMBER}))?\)")


@dataclass(frozen=True)
class UrMove(st.MotionStatement):
    """Any statement that moves the arm; ``depth``: how many routines it stands in."""

    depth: int


@dataclass(frozen=True)
class Inner(st.Statement):
    """A statement of a routine inside the program's own."""


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements, the program's own routine first."""
    open_blocks: list[bool] = []  # whether each open block is a routine
    for line, start, code in st.Lines.of(st.mask_comments(text, r"#[^\r\n]*")):
        said = code.strip()
        place = line, start + len(code) - len(code.lstrip()), said
        depth = sum(open_blocks)
        if not said:
            continue
        if match := _ROUTINE.fullmatch(said):
            open_blocks.append(True)
            yield st.Routine(*place, match[1])
        elif said == "end" and open_blocks and open_blocks.pop():
            yield st.RoutineEnd(*place)
        elif _MOTION.search(said):
            yield UrMove(*place, said.partition("(")[0], depth)
        elif depth > 1:
            open_blocks += [False] * (_BLOCK.fullmatch(said) is not None)
            yield Inner(*place)
        else:
            open_blocks += [False] * (_BLOCK.fullmatch(said) is not None)
            yield _statement(place)
    if open_blocks:
        raise InputError("a block has no 'end', it cannot be read back")


def _statement(place: tuple[int, int, str]) -> st.Statement:
    if match := re.fullmatch(r"sleep\(([^()]*)\)", place[2]):
        return st.Waiting(*place, match[1])
    return st.Pulse(*place) if place[2] == "run edbb_mark()" else st.Statement(*place)


class UrScriptExecution(Execution, family="urscript"):
    """Every movej says its own speed and radius; nothing is remembered."""

    parse_file = staticmethod(parse)

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield what stands in the program's own routine, outside of those that are defined inside it."""
        depth = 0
        for number, statement in enumerate(statements):
            if isinstance(statement, st.Routine):
                depth += 1
            elif isinstance(statement, st.RoutineEnd):
                depth -= 1
                if depth == 0 and number != len(statements) - 1:
                    raise InputError(f"line {statement.line}: statements follow the end of the program")
            elif depth == 1:
                yield statement
            elif depth == 0:
                raise InputError(f"line {statement.line}: '{statement.text}' stands before the program")

    def execute(self, statement: st.Statement) -> bool:
        """Process a movej or a movec; motions other than these raise InputError."""
        if not isinstance(statement, UrMove):
            return False
        match = _MOVE.fullmatch(statement.text) or _CIRCLE.fullmatch(statement.text)
        if match is None or statement.depth != 1:
            raise InputError(f"line {statement.line}: '{statement.text}' is no joint move of this family")
        lists = re.findall(r"\[[^\]]*\]", statement.text)
        *via, goal = ([st.parse_fixed_point(m[1], statement.text) for m in re.finditer(_ANGLE, text)] for text in lists)
        radius = None if match["radius"] is None else 1e3 * st.parse_fixed_point(match["radius"], statement.text)
        speed = st.parse_fixed_point(match["speed"], statement.text)
        self.move(goal, radius, 1e3 * speed if via else speed, *via)
        return True
