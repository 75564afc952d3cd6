"""What a line of G-code does that is no row of words: a statement, a call, a shift of what angles mean, or unknown."""

import re

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


def jumps_to_blocks(text: str) -> bool:
    """Tell whether a program may go on at any of its blocks: jumps but to a label that it holds, modal calls."""
    labels = {label.upper() for label in re.findall(r"(?m)^\s*(?:N\d+\s*)?([A-Za-z_]\w*)\s*:", text)}
    targets = (m["target"].strip().upper() for m in _JUMP.finditer(text))
    return _JUMPS_TO_BLOCK.search(text) is not None or any(target not in labels for target in targets)


def shift_in(text: str) -> str:
    """Return the word of a line that makes axis angles mean something else, or nothing."""
    match = _SHIFTS.search(re.sub(r'"[^"]*"', " ", text))
    return match[0].strip() if match else ""


def calls_program(text: str) -> bool:
    """Tell whether a line runs a program or a function of somebody's own."""
    return _CALL.fullmatch(text) is not None and _CALLS_NOTHING.fullmatch(text) is None


def is_statement(text: str) -> bool:
    """Tell whether a line is known to leave the axes and the meaning of their angles alone."""
    return _STATEMENT.fullmatch(text) is not None
