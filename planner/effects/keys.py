"""Reads the keys that basis functions have in files: ``torque:2`` back to the function.

A new basis function is one more line in ``FORMS``: how its key is made up, the class, and what it looks at.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from planner.effects import gauge, heat, loads, motion, waves
from planner.effects.basis import ONE, AtPlace, AtPoint, LoadTorque, Phi
from planner.effects.combined import Times
from planner.errors import InputError, nearest

MANY = 1_000_000  # no index is larger


@dataclass(frozen=True)
class Form:
    """How the keys of one basis function are made up.

    Attributes:
        pattern: a word, then its arguments, see ``WHOLE``; NUMBER is any number, PHI another key, always last.
        make: the basis function from its arguments, whole numbers counted from 0.
        static: whether it depends on joint angles and loads alone, so that targets can be compensated for it.
        loads: whether it needs to know how the base stands and what the tool weighs.
        gauge: whether it belongs to the gauge, not to the robot.
        run: whether it hangs on the clock or the sessions of one run and means nothing for another.
    """

    pattern: str
    make: Callable[..., Phi]
    static: bool = True
    loads: bool = False
    gauge: bool = False
    run: bool = False

    @property
    def word(self) -> str:
        """The first word."""
        return self.pattern.split(":")[0]

    @property
    def arguments(self) -> list[str]:
        """The kinds of the arguments."""
        return self.pattern.split(":")[1:]


WHOLE: dict[str, tuple[int, Callable[[int], int]]] = {  # first, and last on an arm of N joints
    "JOINT": (1, lambda n: n),
    "LINK": (1, lambda n: n + 1),  # the last stands for the payload
    "STATION": (0, lambda n: n + 1),
    "AXIS": (0, lambda n: 2),
    "PART": (0, lambda n: 5),
    "INDEX": (0, lambda n: MANY),
}
FORMS = (
    Form("1", lambda: ONE),
    Form("times:NUMBER:PHI", lambda factor, phi: Times(phi, factor)),
    Form("sin:JOINT:NUMBER", waves.Sine),
    Form("cos:JOINT:NUMBER", waves.Cosine),
    Form("angle:JOINT:NUMBER", waves.Angle),
    Form("torque:JOINT", LoadTorque, loads=True),
    Form("torque-sign:JOINT", loads.TorqueSign, loads=True),
    Form("moment:STATION:AXIS", loads.LoadMoment, loads=True),
    Form("tip:AXIS", loads.TipMoment, loads=True),
    Form("twist:STATION:AXIS:PART:PHI", loads.Twist),
    Form("weight:JOINT:LINK", loads.WeightTorque, loads=True),
    Form("payload:JOINT", loads.PayloadTorque, loads=True),
    Form("drive:JOINT", loads.DriveTorque, static=False),
    Form("speed-sign:JOINT", motion.SpeedSign, static=False),
    Form("approach:JOINT", motion.Approach, static=False),
    Form("behind:JOINT", motion.Behind, static=False),
    Form("hysteresis:JOINT:NUMBER", motion.Hysteresis, static=False),
    Form("unsettled:JOINT", motion.Unsettled, static=False),
    Form("warmth:NUMBER", heat.Warmth, static=False),
    Form("elapsed:NUMBER", heat.Elapsed, static=False, run=True),
    Form("warm-up:NUMBER:NUMBER", heat.WarmUp, static=False, run=True),
    Form("session:INDEX", heat.InSession, static=False, run=True),
    Form("remounted:INDEX:INDEX", heat.Remounted, static=False, gauge=True, run=True),
    Form("place:INDEX", AtPlace, static=False, gauge=True),
    Form("point:INDEX", AtPoint, static=False, gauge=True),
    Form("length", gauge.Length, static=False, gauge=True),
    Form("length-power:NUMBER:NUMBER:INDEX", gauge.LengthPower, static=False, gauge=True),
    Form("growth:NUMBER", gauge.Growth, static=False, gauge=True),
    Form("length-lag", gauge.LengthLag, static=False, gauge=True),
    Form("bar-fixture:AXIS", lambda axis: gauge.BarAlong("fixture", axis), static=False, gauge=True),
    Form("bar-tool:AXIS", lambda axis: gauge.BarAlong("tool", axis), static=False, gauge=True),
    Form("sag:NUMBER", gauge.Sag, static=False, gauge=True),
    Form("scale-sin:NUMBER", lambda period: gauge.ScaleWave("sin", period), static=False, gauge=True),
    Form("scale-cos:NUMBER", lambda period: gauge.ScaleWave("cos", period), static=False, gauge=True),
    Form("ray:AXIS", gauge.Ray, static=False, gauge=True),
    Form("ray-growth:AXIS:NUMBER", gauge.RayGrowth, static=False, gauge=True),
    Form("point-lag:AXIS", gauge.PointLag, static=False, gauge=True),
    Form("refraction:AXIS", gauge.Refraction, static=False, gauge=True),
)


def forms_of(key: str) -> tuple[Form, ...]:
    """Return the form of ``key``, and of the keys inside it.

    Raises:
        InputError: no basis function is called so, or an argument is missing.
    """
    word, *words = key.split(":")
    for form in FORMS:
        if form.word == word:
            break
    else:
        known = ", ".join(f.pattern for f in FORMS)
        near = nearest(word, [f.word for f in FORMS])
        raise InputError(f"the basis function '{key}' is unknown{near} (known: {known})")
    kinds = form.arguments
    inner = "PHI" in kinds
    if len(words) < len(kinds) or (len(words) > len(kinds) and not inner):
        raise InputError(f"the basis function '{key}' must read {form.pattern}")
    return (form, *forms_of(":".join(words[len(kinds) - 1 :]))) if inner else (form,)


def is_static(key: str) -> bool:
    """Tell whether ``key`` stands for a function of joint angles and loads alone; raises as :func:`forms_of`."""
    return all(f.static for f in forms_of(key))


def needs_loads(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the loads; raises as :func:`forms_of`."""
    return any(f.loads for f in forms_of(key))


def of_run(key: str) -> bool:
    """Tell whether ``key`` hangs on the clock or sessions of one run; raises as :func:`forms_of`."""
    return any(f.run for f in forms_of(key))


def of_gauge(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the gauge; raises as :func:`forms_of`."""
    return any(f.gauge for f in forms_of(key))


def phi_of(key: str, n_joints: int | None = None) -> Phi:
    """Return the basis function whose ``key`` this is.

    Args:
        key: as :attr:`planner.effects.Phi.key` writes it.
        n_joints: number N of the robot's joints, where that is known.

    Raises:
        InputError: no basis function is called so, or its arguments are wrong.
    """
    form = forms_of(key)[0]
    kinds = form.arguments
    words = key.split(":", len(kinds))[1:]
    return form.make(*(_argument(key, k, w, n_joints) for k, w in zip(kinds, words, strict=True)))


def _argument(key: str, kind: str, word: str, n_joints: int | None) -> int | float | Phi:
    if kind == "PHI":
        return phi_of(word, n_joints)
    if kind == "NUMBER":
        return _number(key, word)
    first, end = WHOLE[kind]
    last = end(MANY if n_joints is None else n_joints)
    if not (word.isascii() and word.isdigit()) or not first <= int(word) <= last:
        allowed = f"{first}, {first + 1}, {first + 2} …" if last >= MANY else f"a number from {first} to {last}"
        raise InputError(f"the basis function '{key}' has '{word}' as {kind}, where {allowed} may stand")
    return int(word) - first


def _number(key: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"the basis function '{key}' has '{word}' where a number belongs")
    return value
