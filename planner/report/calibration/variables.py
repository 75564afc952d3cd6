"""What an effect is drawn against: the quantity that its basis function looks at, in the unit of its label."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.effects import Context, gauge, heat, loads, motion, waves
from planner.effects.basis import LoadTorque, Phi
from planner.units import Array, to_deg, to_mm


@dataclass(frozen=True)
class Variable:
    """Values (n,) in the unit of ``label``; ``folded`` at ``period`` where the effect comes again and again."""

    label: str
    values: Array
    period: float | None = None

    @property
    def folded(self) -> Array:
        """Values within one period."""
        return self.values if self.period is None else np.mod(self.values, self.period)


def variable(phi: Phi, c: Context) -> Variable | None:
    """Return what a basis function looks at, ``None`` where it looks at several things at once."""
    for kind, look in LOOKS.items():
        if isinstance(phi, kind):
            return look(phi, c)
    return None


def _wave(phi: waves.Sine | waves.Cosine, c: Context) -> Variable:
    q = to_deg(c.samples.q[:, phi.joint])
    period = 360.0 / phi.frequency
    if np.ptp(q) < 1.5 * period:
        return Variable(f"joint {phi.joint + 1} (deg)", q)
    return Variable(f"joint {phi.joint + 1}, folded at {period:.4g} deg (deg)", q, period)


def _scale(phi: gauge.ScaleWave, c: Context) -> Variable:
    period = float(to_mm(phi.period))
    return Variable(f"length, folded at {period:.4g} mm (mm)", to_mm(c.length), period)


def _angle(phi: waves.Angle, c: Context) -> Variable:
    return Variable(f"joint {phi.joint + 1} (deg)", to_deg(c.samples.q[:, phi.joint]))


def _torque(phi: LoadTorque | loads.TorqueSign, c: Context) -> Variable:
    return Variable(f"load on joint {phi.joint + 1} (Nm)", c.load_torque[:, phi.joint])


def _moment(phi: loads.LoadMoment, c: Context) -> Variable:
    return Variable(f"moment of the weights about {'xyz'[phi.axis]} (Nm)", phi(c))


def _sense(phi: motion.Approach | motion.SpeedSign, c: Context) -> Variable:
    way = "approached" if isinstance(phi, motion.Approach) else "moving"
    return Variable(f"joint {phi.joint + 1}: {way} from above (−1) or below (+1)", 2 * phi(c))


def _plain(label: str, factor: float = 1.0) -> Callable[..., Variable]:
    """Draw against the basis function itself; JOINT in the label becomes its number."""

    def look(phi: Phi, c: Context) -> Variable:
        return Variable(label.replace("JOINT", str(getattr(phi, "joint", 0) + 1)), factor * phi(c))

    return look


def _time(_: Phi, c: Context) -> Variable:
    assert c.samples.t is not None
    return Variable("time (min)", (c.samples.t - c.samples.t.min()) / 60)


def _temperature(_: Phi, c: Context) -> Variable:
    assert c.samples.temperature is not None
    return Variable("temperature (°C)", c.samples.temperature)


def _session(_: Phi, c: Context) -> Variable:
    assert c.samples.session is not None
    return Variable("session", c.samples.session.astype(float))


def _length(_: Phi, c: Context) -> Variable:
    return Variable("length (mm)", to_mm(c.length))


LOOKS: dict[type, Callable[..., Variable]] = {
    waves.Sine: _wave,
    waves.Cosine: _wave,
    waves.Angle: _angle,
    LoadTorque: _torque,
    loads.TorqueSign: _torque,
    loads.LoadMoment: _moment,
    loads.DriveTorque: _plain("measured torque of joint JOINT (Nm)"),
    loads.PayloadTorque: _plain("torque of the payload about joint JOINT (Nm)"),
    motion.Approach: _sense,
    motion.SpeedSign: _sense,
    motion.Hysteresis: _plain("joint JOINT: side of its play (−½ … ½)"),
    motion.Behind: _plain("speed of joint JOINT (deg/s)", float(-to_deg(1.0))),
    motion.Unsettled: _plain("joint JOINT: commanded less read (deg)", float(to_deg(1.0))),
    heat.Elapsed: _time,
    heat.WarmUp: _time,
    heat.Warmth: _temperature,
    heat.InSession: _session,
    heat.Remounted: _session,
    gauge.Growth: _temperature,
    gauge.Length: _length,
    gauge.LengthPower: _length,
    gauge.Sag: _length,
    gauge.ScaleWave: _scale,
    gauge.LengthLag: _plain("speed of the length (mm/s)", float(-to_mm(1.0))),
}
