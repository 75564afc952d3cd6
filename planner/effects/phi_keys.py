"""Reads the keys that basis functions have in files: ``torque:2`` back to the function.

A new basis function is one more line in ``FORMS``: how its key is made up, the class, and what it looks at.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import planner.effects.backlash as motion
import planner.effects.gauge_functions as gauge
import planner.effects.gears as waves
import planner.effects.load_functions as loads
import planner.effects.thermal as heat
from planner.common.errors import InputError, did_you_mean
from planner.effects.basis import ONE, AtPlace, AtPoint, LoadTorque, Phi, Times

LARGEST_INDEX = 1_000_000  # no index is larger


@dataclass(frozen=True)
class KeyPattern:
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


INDEX_RANGES: dict[str, tuple[int, Callable[[int], int]]] = {  # first, and last on an arm of N joints
    "JOINT": (1, lambda n: n),
    "LINK": (1, lambda n: n + 1),  # the last stands for the payload
    "STATION": (0, lambda n: n + 1),
    "AXIS": (0, lambda n: 2),
    "PART": (0, lambda n: 5),
    "INDEX": (0, lambda n: LARGEST_INDEX),
}
KEY_PATTERNS = (
    KeyPattern("1", lambda: ONE),
    KeyPattern("times:NUMBER:PHI", lambda factor, phi: Times(phi, factor)),
    KeyPattern("sin:JOINT:NUMBER", waves.Sine),
    KeyPattern("cos:JOINT:NUMBER", waves.Cosine),
    KeyPattern("angle:JOINT:NUMBER", waves.Angle),
    KeyPattern("torque:JOINT", LoadTorque, loads=True),
    KeyPattern("torque-sign:JOINT", loads.TorqueSign, loads=True),
    KeyPattern("moment:STATION:AXIS", loads.LoadMoment, loads=True),
    KeyPattern("tip:AXIS", loads.TipMoment, loads=True),
    KeyPattern("twist:STATION:AXIS:PART:PHI", loads.StationTwist),
    KeyPattern("weight:JOINT:LINK", loads.WeightTorque, loads=True),
    KeyPattern("payload:JOINT", loads.PayloadTorque, loads=True),
    KeyPattern("drive:JOINT", loads.DriveTorque, static=False),
    KeyPattern("speed-sign:JOINT", motion.SpeedSign, static=False),
    KeyPattern("approach:JOINT", motion.ApproachDirection, static=False),
    KeyPattern("behind:JOINT", motion.SpeedLag, static=False),
    KeyPattern("hysteresis:JOINT:NUMBER", motion.Hysteresis, static=False),
    KeyPattern("unsettled:JOINT", motion.SettlingError, static=False),
    KeyPattern("warmth:NUMBER", heat.TemperatureRise, static=False),
    KeyPattern("elapsed:NUMBER", heat.ElapsedTime, static=False, run=True),
    KeyPattern("warm-up:NUMBER:NUMBER", heat.WarmUp, static=False, run=True),
    KeyPattern("session:INDEX", heat.InSession, static=False, run=True),
    KeyPattern("remounted:INDEX:INDEX", heat.MountedAnew, static=False, gauge=True, run=True),
    KeyPattern("place:INDEX", AtPlace, static=False, gauge=True),
    KeyPattern("point:INDEX", AtPoint, static=False, gauge=True),
    KeyPattern("length", gauge.BarLength, static=False, gauge=True),
    KeyPattern("length-power:NUMBER:NUMBER:INDEX", gauge.LengthPower, static=False, gauge=True),
    KeyPattern("growth:NUMBER", gauge.LengthGrowth, static=False, gauge=True),
    KeyPattern("length-lag", gauge.LengthLag, static=False, gauge=True),
    KeyPattern("bar-fixture:AXIS", lambda axis: gauge.BallOffset("fixture", axis), static=False, gauge=True),
    KeyPattern("bar-tool:AXIS", lambda axis: gauge.BallOffset("tool", axis), static=False, gauge=True),
    KeyPattern("sag:NUMBER", gauge.BarSag, static=False, gauge=True),
    KeyPattern("scale-sin:NUMBER", lambda period: gauge.ScaleWave("sin", period), static=False, gauge=True),
    KeyPattern("scale-cos:NUMBER", lambda period: gauge.ScaleWave("cos", period), static=False, gauge=True),
    KeyPattern("ray:AXIS", gauge.GaugeRay, static=False, gauge=True),
    KeyPattern("ray-growth:AXIS:NUMBER", gauge.RayGrowth, static=False, gauge=True),
    KeyPattern("point-lag:AXIS", gauge.PointLag, static=False, gauge=True),
    KeyPattern("refraction:AXIS", gauge.BeamRefraction, static=False, gauge=True),
)


def patterns_of(key: str) -> tuple[KeyPattern, ...]:
    """Return the form of ``key``, and of the keys inside it.

    Raises:
        InputError: no basis function is called so, or an argument is missing.
    """
    word, *words = key.split(":")
    for form in KEY_PATTERNS:
        if form.word == word:
            break
    else:
        known = ", ".join(f.pattern for f in KEY_PATTERNS)
        near = did_you_mean(word, [f.word for f in KEY_PATTERNS])
        raise InputError(f"the basis function '{key}' is unknown{near} (known: {known})")
    kinds = form.arguments
    inner = "PHI" in kinds
    if len(words) < len(kinds) or (len(words) > len(kinds) and not inner):
        raise InputError(f"the basis function '{key}' must read {form.pattern}")
    return (form, *patterns_of(":".join(words[len(kinds) - 1 :]))) if inner else (form,)


def is_static(key: str) -> bool:
    """Tell whether ``key`` stands for a function of joint angles and loads alone; raises as :func:`patterns_of`."""
    return all(f.static for f in patterns_of(key))


def needs_loads(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the loads; raises as :func:`patterns_of`."""
    return any(f.loads for f in patterns_of(key))


def depends_on_run(key: str) -> bool:
    """Tell whether ``key`` hangs on the clock or sessions of one run; raises as :func:`patterns_of`."""
    return any(f.run for f in patterns_of(key))


def belongs_to_gauge(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the gauge; raises as :func:`patterns_of`."""
    return any(f.gauge for f in patterns_of(key))


def phi_from_key(key: str, n_joints: int | None = None) -> Phi:
    """Return the basis function whose ``key`` this is.

    Args:
        key: as :attr:`planner.effects.basis.Phi` writes it.
        n_joints: number N of the robot's joints, where that is known.

    Raises:
        InputError: no basis function is called so, or its arguments are wrong.
    """
    form = patterns_of(key)[0]
    kinds = form.arguments
    words = key.split(":", len(kinds))[1:]
    return form.make(*(_parse_argument(key, k, w, n_joints) for k, w in zip(kinds, words, strict=True)))


def _parse_argument(key: str, kind: str, word: str, n_joints: int | None) -> int | float | Phi:
    if kind == "PHI":
        return phi_from_key(word, n_joints)
    if kind == "NUMBER":
        return _parse_number(key, word)
    first, end = INDEX_RANGES[kind]
    last = end(LARGEST_INDEX if n_joints is None else n_joints)
    if not (word.isascii() and word.isdigit()) or not first <= int(word) <= last:
        allowed = (
            f"{first}, {first + 1}, {first + 2} …" if last >= LARGEST_INDEX else f"a number from {first} to {last}"
        )
        raise InputError(f"the basis function '{key}' has '{word}' as {kind}, where {allowed} may stand")
    return int(word) - first


def _parse_number(key: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"the basis function '{key}' has '{word}' where a number belongs")
    return value
