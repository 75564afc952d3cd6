"""What an effect is drawn against: the quantity that its basis function looks at, in the unit of its label."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import planner.effects.backlash as motion
import planner.effects.gauge_functions as gauge
import planner.effects.gears as waves
import planner.effects.load_functions as loads
import planner.effects.thermal as heat
from planner.common.units import Array, to_deg, to_mm
from planner.effects.basis import LoadTorque, Phi
from planner.effects.context import Context


@dataclass(frozen=True)
class EffectVariable:
    """Values (n,) in the unit of ``label``; ``folded`` at ``period`` where the effect comes again and again."""

    label: str
    values: Array
    period: float | None = None

    @property
    def folded(self) -> Array:
        """Values within one period."""
        return self.values if self.period is None else np.mod(self.values, self.period)


def effect_variable(phi: Phi, c: Context) -> EffectVariable | None:
    """Return what a basis function looks at, ``None`` where it looks at several things at once."""
    for kind, look in LOOKS.items():
        if isinstance(phi, kind):
            return look(phi, c)
    return None


def _wave(phi: waves.Sine | waves.Cosine, c: Context) -> EffectVariable:
    q = to_deg(c.samples.q[:, phi.joint])
    period = 360.0 / phi.frequency
    if np.ptp(q) < 1.5 * period:
        return EffectVariable(f"joint {phi.joint + 1} (deg)", q)
    return EffectVariable(f"joint {phi.joint + 1}, folded at {period:.4g} deg (deg)", q, period)


def _scale(phi: gauge.ScaleWave, c: Context) -> EffectVariable:
    period = float(to_mm(phi.period))
    return EffectVariable(f"length, folded at {period:.4g} mm (mm)", to_mm(c.length), period)


def _angle(phi: waves.Angle, c: Context) -> EffectVariable:
    return EffectVariable(f"joint {phi.joint + 1} (deg)", to_deg(c.samples.q[:, phi.joint]))


def _torque(phi: LoadTorque | loads.TorqueSign, c: Context) -> EffectVariable:
    return EffectVariable(f"load on joint {phi.joint + 1} (Nm)", c.load_torque[:, phi.joint])


def _moment(phi: loads.LoadMoment, c: Context) -> EffectVariable:
    return EffectVariable(f"moment of the weights about {'xyz'[phi.axis]} (Nm)", phi(c))


def _sense(phi: motion.ApproachDirection | motion.SpeedSign, c: Context) -> EffectVariable:
    way = "approached" if isinstance(phi, motion.ApproachDirection) else "moving"
    return EffectVariable(f"joint {phi.joint + 1}: {way} from above (−1) or below (+1)", 2 * phi(c))


def _plain(label: str, factor: float = 1.0) -> Callable[..., EffectVariable]:
    """Draw against the basis function itself; JOINT in the label becomes its number."""

    def look(phi: Phi, c: Context) -> EffectVariable:
        return EffectVariable(label.replace("JOINT", str(getattr(phi, "joint", 0) + 1)), factor * phi(c))

    return look


def _time(_: Phi, c: Context) -> EffectVariable:
    assert c.samples.t is not None
    return EffectVariable("time (min)", (c.samples.t - c.samples.t.min()) / 60)


def _temperature(_: Phi, c: Context) -> EffectVariable:
    assert c.samples.temperature is not None
    return EffectVariable("temperature (°C)", c.samples.temperature)


def _session(_: Phi, c: Context) -> EffectVariable:
    assert c.samples.session is not None
    return EffectVariable("session", c.samples.session.astype(float))


def _length(_: Phi, c: Context) -> EffectVariable:
    return EffectVariable("length (mm)", to_mm(c.length))


LOOKS: dict[type, Callable[..., EffectVariable]] = {
    waves.Sine: _wave,
    waves.Cosine: _wave,
    waves.Angle: _angle,
    LoadTorque: _torque,
    loads.TorqueSign: _torque,
    loads.LoadMoment: _moment,
    loads.DriveTorque: _plain("measured torque of joint JOINT (Nm)"),
    loads.PayloadTorque: _plain("torque of the payload about joint JOINT (Nm)"),
    motion.ApproachDirection: _sense,
    motion.SpeedSign: _sense,
    motion.Hysteresis: _plain("joint JOINT: side of its play (−½ … ½)"),
    motion.SpeedLag: _plain("speed of joint JOINT (deg/s)", float(-to_deg(1.0))),
    motion.SettlingError: _plain("joint JOINT: commanded less read (deg)", float(to_deg(1.0))),
    heat.ElapsedTime: _time,
    heat.WarmUp: _time,
    heat.TemperatureRise: _temperature,
    heat.InSession: _session,
    heat.MountedAnew: _session,
    gauge.LengthGrowth: _temperature,
    gauge.BarLength: _length,
    gauge.LengthPower: _length,
    gauge.BarSag: _length,
    gauge.ScaleWave: _scale,
    gauge.LengthLag: _plain("speed of the length (mm/s)", float(-to_mm(1.0))),
}
