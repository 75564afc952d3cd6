"""Yaskawa INFORM, a job as text (.JBI): taught positions under ``//POS``, instructions under ``//INST``.

Sources: NX100 and DX100 "Interface with an Easy Offline Teaching System" (job data format, RCONF), NX100 operator's
manual 3.9 (manipulator types), FS100 INFORM manual. The angles turn "in the order of Rz, Ry and Rx" (DX100, 4.3.1.1):
R = Rz(Rz) Ry(Ry) Rx(Rx). Flip is said of the R axis (NX100, 3.9): -90 to 90 deg, 270 to 360, -360 to -270.
"""

import re
from collections.abc import Iterator

import planner.programs.languages.declared as said
import planner.programs.languages.statements as st

_POSITION = re.compile(r"(?P<name>B?[CP]\d+|E[CX]\d+)\s*=\s*(?P<numbers>.*)")
_MOTION = re.compile(r"(?:\+|[ESG])?(?:MOV[JLCS]|IMOV|REFP|MOVJS?)\b.*")
_MOVE = re.compile(r"(?P<word>MOV[JLCS])\s+(?P<name>C\d+)(?P<rest>(?:\s.*)?)")
_TAGS = re.compile(r"(?:\s+(?:(?:VJ|VR?|VE|PL|CR|ACC|DEC|FPT)=\S+|FPT|NWAIT|UNTIL\s.*))*\s*")
_FLOW = re.compile(r"(?:\*\w+|(?:JUMP|IFTHEN\w*|ELSE\w*|ENDIF|FOR|NEXT|WHILE\w*|ENDWHILE|SWITCH|CASE|DEFAULT|RET)\b.*)")


def _shape(form: str) -> said.ArmShape | None:
    """Return the shape of ``///RCONF``: flip, lower arm, rear, and half turns of R, T, S."""
    bits = [cell.strip() for cell in form.split(",")]
    if len(bits) < 6 or not set(bits[:6]) <= {"0", "1"}:
        return None
    of_r, of_t, of_s = (
        ((180.0, 360.0), (-360.0, -180.0)) if bit == "1" else ((-180.0, 180.0),) for bit in bits[3:6]
    )  # [deg]
    flip = ((-90.0, 90.0), (270.0, 360.0), (-360.0, -270.0))  # of the R axis, whatever the sign of the B axis [deg]
    no_flip = ((90.0, 270.0), (-270.0, -90.0))
    wrist = no_flip if bits[0] == "1" else flip
    both = tuple((max(a, c), min(b, d)) for a, b in wrist for c, d in of_r if max(a, c) < min(b, d))
    s, r, t = 0, 3, 5  # joints
    return said.ArmShape(rear=bits[2] == "1", elbow_up=bits[1] == "0", within=((r, both), (t, of_t), (s, of_s)))


def _position(place: tuple[int, int, str], found: re.Match[str], head: dict[str, str]) -> st.Statement:
    name, kind = found["name"], head.get("POSTYPE", "")
    if not name.startswith(("C", "P")):
        return st.Passive(*place)  # a base or a station, which the moves of the robot name
    why = "is a variable of the controller, which other jobs may write" if name.startswith("P") else ""
    start = place[1] + found.start("numbers")
    numbers = said.numbers_in(found["numbers"], start, found["numbers"].count(",") + 1)
    tool = f"TOOL {head['TOOL']}" if "TOOL" in head else None
    if not numbers:
        return said.Position(*place, name, why_not="has no plain numbers")
    if kind == "PULSE":
        return said.Position(*place, name, joints=numbers, tool=tool, why_not=why)
    base = {"BASE": "", "ROBOT": "", "USER": f"USER {head.get('USER', '0')}"}.get(kind)
    shape = _shape(head.get("RCONF", ""))
    if base is None or shape is None or len(numbers) != 6:
        why = f"is of the position type {kind or 'that is not said'}, or says no form (RCONF)"
    return said.Position(*place, name, pose=numbers[:6], shape=shape, tool=tool, base=base, why_not=why)


def _move(place: tuple[int, int, str], found: re.Match[str]) -> said.Move:
    tags = dict(re.findall(r"(\w+)=(\S+)", found["rest"]))
    why = "" if _TAGS.fullmatch(found["rest"]) else f"says '{found['rest'].strip()[:40]}', which may shift it"
    speed = float(tags["VJ"]) if re.fullmatch(st.NUMBER, tags.get("VJ", "")) else None
    level = tags.get("PL", "1")  # without one the controller rounds
    blend = None if level == "0" else 1.0
    straight = found["word"] != "MOVJ"
    return said.Move(*place, found["word"], (found["name"],), straight=straight, speed=speed, blend=blend, why_not=why)


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of a job; remarks are left out, and texts in quotes are blank."""
    head: dict[str, str] = {}
    for line, start, row in st.Lines.of(text):
        code = row.strip()
        place = line, start + len(row) - len(row.lstrip()), re.sub(r'"[^"]*"', '""', code)
        if not code or code.startswith("'"):
            continue
        if code.startswith("/"):
            key, _, value = code.lstrip("/").partition(" ")
            head[key] = value.strip()
            yield st.Statement(*place)
        elif found := _POSITION.fullmatch(code):
            yield _position(place, found, head)
        elif found := _MOVE.fullmatch(code):
            yield _move(place, found)
        elif _MOTION.fullmatch(code):
            yield st.MotionStatement(*place, code.split()[0])
        elif found := re.fullmatch(r"TIMER T=(\S+)", code):
            yield st.Waiting(*place, found[1])
        elif re.fullmatch(r"PULSE OT#\(\d+\) T=\S+", code):
            yield st.Pulse(*place)
        elif found := re.fullmatch(r"CALL\s+(?:JOB:)?(\S+).*", code):
            yield st.Call(*place, found[1])
        else:
            yield (st.Flow if _FLOW.fullmatch(code) else st.Statement)(*place)


class InformExecution(said.DeclaredExecution, family="inform"):
    """Every move says its own speed and position level."""

    parse_file = staticmethod(parse)
    rotation = "xyz"
    shifts = r"(?:SFTON|MSHIFT|CVTON|SYSTART|VISION)\b"
