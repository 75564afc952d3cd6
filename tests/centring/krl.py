"""Runs the few words of KRL that the centring program is made of, as KUKA's manuals describe them; others are errors.

Interrupts are seen by their edge, while the arm moves or waits; RESUME gives up everything below the level at which the
interrupt was declared, and needs $ADVANCE=0.
"""

import re
import time


class _Resume(Exception):
    pass


class _Return(Exception):
    pass


def value_of(text):
    """A value as KRL writes it: TRUE, 12, -0.5, {X 1.0,Y 2.0}."""
    text = text.strip()
    if text in ("TRUE", "FALSE"):
        return text == "TRUE"
    if text.startswith("{"):
        parts = re.findall(r"([A-Z]\d?) (-?[\d.]+(?:[eE][-+]?\d+)?)", text)
        return {k: float(v) for k, v in parts}
    return float(text) if "." in text else int(text)


def text_of(value):
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} {v:.5f}" for k, v in value.items()) + "}"
    return str(value)


def declared(dat):
    """Variables of a .dat with their values."""
    found = re.findall(r"^DECL GLOBAL (INT|BOOL|REAL|E6AXIS|FRAME) (\w+)=(.*?)\r?$", dat, re.MULTILINE)
    return {name: value_of(value) for _, name, value in found}


class Program:
    """A .src with its .dat; ``arm`` has ``ptp(axes)`` and ``lin_rel(frame)``, generators that yield while it moves."""

    def __init__(self, src, dat, arm):
        self.values, self.arm, self.alive = declared(dat), arm, True
        self.system = {"$ADVANCE": 3, "$RED_VEL": 100, "$VEL.CP": 0.25, "$ACC.CP": 2.3}
        self.timer = 0.0  # when timer 10 passes zero
        self.interrupts, self.on, self.depth = {}, {}, 0
        self.done = []  # statements that were carried out
        self.reduced = []  # $RED_VEL at every move of the centring
        self.parts, self.takes, self.local = {}, {}, [{}]
        form = r"^(?:GLOBAL )?DEF (\w+) ?\(([^)]*)\)\r?\n(.*?)^END\r?$"
        for name, takes, body in re.findall(form, src, re.MULTILINE | re.DOTALL):
            self.takes[name] = [part.removesuffix(":IN") for part in takes.strip().split(",") if part.strip()]
            lines = [line.strip() for line in body.splitlines()]
            self.parts[name] = [line for line in lines if line and not line.startswith(";")]

    def run(self, name="EDBB_CENTRE"):
        self._call(name)

    def evaluate(self, text):
        text = re.sub(r"<>", "!=", text)
        text = re.sub(r"\bOR\b", "or", text)
        text = re.sub(r"([$A-Z][A-Z_0-9]*(?:\.CP)?)(\[\d+\])?(?:\.([A-Z]))?(?!\w|\()", self._named, text)
        return eval(text, {"ABS": abs, "v": self._value})

    def _named(self, match):
        if match[1] in ("TRUE", "FALSE"):
            return match[1].capitalize()
        return f"v({match[1]!r}, {match[3]!r})"

    def _value(self, name, part):
        if name == "$TIMER_FLAG":
            return time.monotonic() > self.timer
        scope = next(scope for scope in (self.local[-1], self.values, self.system) if name in scope)
        value = scope[name]
        return value if part is None else value[part]

    def _call(self, name, *given):
        self.depth += 1
        self.local.append(dict(zip(self.takes[name], given, strict=True)))
        try:
            self._block(self.parts[name], 0, len(self.parts[name]))
        except _Return:
            pass
        finally:
            self.depth -= 1
            self.local.pop()

    def _block(self, lines, at, end):
        while at < end and self.alive:
            line = lines[at]
            if line == "LOOP":
                close = _close(lines, at, "LOOP", "ENDLOOP")
                while self.alive:
                    self._block(lines, at + 1, close)
                at = close
            elif line.startswith("IF "):
                close = _close(lines, at, "IF ", "ENDIF")
                if self.evaluate(line[3 : line.rindex("THEN")]):
                    self._block(lines, at + 1, close)
                at = close
            elif line.startswith("SWITCH "):
                close = _close(lines, at, "SWITCH ", "ENDSWITCH")
                self._switch(lines, at, close)
                at = close
            else:
                self._one(line)
            at += 1

    def _switch(self, lines, at, close):
        wanted = self.evaluate(lines[at][7:])
        heads = [k for k in range(at, close) if lines[k].startswith(("CASE ", "DEFAULT"))]
        for head, after in zip(heads, [*heads[1:], close], strict=True):
            if lines[head] == "DEFAULT" or self.evaluate(lines[head][5:]) == wanted:
                self._block(lines, head + 1, after)
                return

    def _one(self, line):  # noqa: C901 - a table of statements
        self.done.append(line)
        if line.startswith(("GLOBAL INTERRUPT DECL 3 ", "BAS (#")) or line in ("INTERRUPT ON 3", "PTP $AXIS_ACT"):
            return
        if found := re.fullmatch(r"INTERRUPT DECL (\d+) WHEN (.+) DO (\w+) \( \)", line):
            self.interrupts[found[1]] = (found[2], found[3], self.depth)
        elif found := re.fullmatch(r"INTERRUPT (ON|OFF) (\d+)", line):
            self.on.pop(found[2], None)
            if found[1] == "ON":
                self.on[found[2]] = self.evaluate(self.interrupts[found[2]][0])
        elif found := re.fullmatch(r"(\$?\w+(?:\.CP)?)(\[\d+\])?=(.+)", line):
            self._assign(found[1], self.evaluate(found[3]))
        elif found := re.fullmatch(r"DECL (?:INT|REAL) ([\w,]+)", line):
            self.local[-1] = dict.fromkeys(found[1].split(",")) | self.local[-1]
        elif found := re.fullmatch(r"(\w+) \((.*)\)", line):
            self._guarded(found[1], *(self.evaluate(part) for part in found[2].split(",") if part.strip()))
        elif found := re.fullmatch(r"PTP ({.*}|\w+)", line):
            self._moved(self.arm.ptp(self.values[found[1]] if found[1] in self.values else value_of(found[1])))
        elif found := re.fullmatch(r"LIN_REL (\w+) #TOOL", line):
            self.reduced.append(self.system["$RED_VEL"])
            self._moved(self.arm.lin_rel(self.values[found[1]]))
        elif found := re.fullmatch(r"WAIT SEC (\S+)", line):
            time.sleep(min(float(found[1]), 0.001))
        elif line == "RETURN":
            raise _Return
        elif line == "RESUME":
            assert self.system["$ADVANCE"] == 0
            raise _Resume
        else:
            assert line == "BRAKE F", f"unknown KRL: {line}"

    def _assign(self, name, value):
        if name == "$TIMER":
            self.timer = time.monotonic() - value / 1000
        elif name in self.local[-1]:
            self.local[-1][name] = value
        elif name.startswith("$"):
            self.system[name] = value
        else:
            assert name in self.values, f"{name} is not declared"
            self.values[name] = value

    def _guarded(self, name, *given):
        """Call a subprogram; RESUME comes back to here if its interrupt was declared at this level."""
        level = self.depth
        try:
            self._call(name, *given)
        except _Resume:
            if any(declared_at != level for _, _, declared_at in self.interrupts.values()):
                raise

    def _moved(self, steps):
        """Move on until the end, or until an interrupt brakes."""
        for _ in steps:
            for number, before in list(self.on.items()):
                condition, handler, _ = self.interrupts[number]
                now = self.evaluate(condition)
                self.on[number] = now
                if now and not before:
                    self._call(handler)


def _close(lines, at, opening, closing):
    depth = 0
    for k in range(at, len(lines)):
        depth += lines[k].startswith(opening) - (lines[k] == closing)
        if depth == 0:
            return k
    raise AssertionError(f"{opening.strip()} without {closing}")
