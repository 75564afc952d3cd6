"""An arm as data: standard or modified DH with Hayati's beta, forward pass and moments of weight, in plain numpy.

Standard DH row i:  [tilt_x tilt_y] Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)
Modified DH row i:  Rx(alpha) Tx(a) Ry(beta) [tilt_x tilt_y] Rz(theta) Tz(d), alpha, a and beta with index i - 1
Six motions of the base stand before the rows and two tilts of the flange behind them; all of these are zero unless
an error or an effect moves them. Metres, radians, kilograms; arrays inside are (3, n).
"""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROBOTS = Path(__file__).resolve().parents[3] / "robots"
GRAVITY = 9.81  # [m/s2], along -z of the base


@dataclass(frozen=True)
class Slot:
    """One elementary motion along or about x, y or z; ``joint`` where a joint angle is added."""

    name: str
    turns: bool
    axis: int
    nominal: float = 0.0
    joint: int | None = None


@dataclass(frozen=True, eq=False)
class Stance:
    """Where an arm stands: flange R (3, 3, n) and p (3, n), centres of the links (N, 3, n), kept axes and origins."""

    R: np.ndarray
    p: np.ndarray
    centres: np.ndarray
    axes: dict
    origins: dict


@dataclass(frozen=True, eq=False)
class Arm:
    """Slots from base to flange; ``link_end[i]`` slots lead to link frame i + 1; theta = sense @ q + offset."""

    name: str
    convention: str
    slots: tuple[Slot, ...]
    link_end: tuple[int, ...]
    sense: np.ndarray
    offset: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    payload: float

    @classmethod
    def from_toml(cls, path):
        """Read ``robot.toml``; ``path`` may be the name of a shipped robot."""
        path = Path(path) if str(path).endswith(".toml") else ROBOTS / str(path) / "robot.toml"
        return _arm(tomllib.loads(path.read_text()))

    @property
    def n_joints(self):
        return len(self.lower)

    @property
    def names(self):
        """Names of all slots."""
        return tuple(s.name for s in self.slots)

    @property
    def geometry(self):
        """Names of the DH errors: four a row, and beta where neighbouring axes are near-parallel."""
        rows = {"theta", "d", "a", "alpha"}
        parallel = {
            "beta" + s.name[5:]
            for s in self.slots
            if s.name.startswith("alpha") and abs(np.sin(s.nominal)) < 0.09 and self._between_axes(s.name)
        }
        return tuple(n for n in self.names if n.rstrip("0123456789") in rows or n in parallel)

    def _between_axes(self, name):
        return 0 < int(name[5:]) < self.n_joints

    def reference_torque(self, joint=0):
        """Weight beyond a joint (0: beyond the base), payload too, at half of what is left of the reach [N m]."""
        first = self.names.index(f"theta{joint}") if joint else 0
        reach = sum(abs(s.nominal) for s in self.slots[first:] if not s.turns)
        return GRAVITY * (self.mass[max(joint - 1, 0) :].sum() + self.payload) * reach / 2

    def flange(self, q, errors=None):
        """Flange R (n, 3, 3) and p (n, 3) [m] for controller angles q (n, N) [rad]."""
        stance = self.walk(q, errors or {})
        return np.moveaxis(stance.R, 2, 0), stance.p.T

    def walk(self, q, errors: Mapping, keep: Iterable[str] = ()) -> Stance:
        """Forward pass; ``errors`` maps slots to numbers or (n,) arrays, axes of the slots in ``keep`` are kept."""
        unknown = set(errors) - set(self.names)
        if unknown:
            raise KeyError(f"no such slot: {sorted(unknown)}")
        theta, n = np.asarray(q) @ self.sense.T + self.offset, len(q)
        keep, axes, origins, centres = set(keep), {}, {}, []
        R = [np.repeat(np.eye(3)[:, [k]], n, axis=1) for k in range(3)]
        p = np.zeros((3, n))
        for k, slot in enumerate(self.slots):
            centres += [_at(R, p, self.com[i]) for i, end in enumerate(self.link_end) if end == k]
            if slot.name in keep:
                axes[slot.name], origins[slot.name] = R[slot.axis], p
            value = slot.nominal + errors.get(slot.name, 0.0)
            value = value if slot.joint is None else value + theta[:, slot.joint]
            if not np.any(value):
                continue
            if slot.turns:
                i, j, c, s = (slot.axis + 1) % 3, (slot.axis + 2) % 3, np.cos(value), np.sin(value)
                R[i], R[j] = c * R[i] + s * R[j], c * R[j] - s * R[i]
            else:
                p = p + value * R[slot.axis]
        centres += [_at(R, p, self.com[i]) for i, end in enumerate(self.link_end) if end == len(self.slots)]
        return Stance(np.stack(R, axis=1), p, np.stack(centres), axes, origins)

    def distal(self, name):
        """Which links hang beyond a slot, (N,) bool."""
        return np.array(self.link_end) > self.names.index(name)


def moment_of_weight(arm, stance, name, mass, extra=()):
    """Moment (n,) [N m] of gravity about the slot's axis; ``extra`` are (mass, centre (3, n)) beyond the flange."""
    mass = mass * arm.distal(name)
    total, first = mass.sum(), np.einsum("l,lkn->kn", mass, stance.centres)
    for m, centre in extra:
        total, first = total + m, first + m * centre
    arm_of = first - total * stance.origins[name]
    return GRAVITY * (stance.axes[name][1] * arm_of[0] - stance.axes[name][0] * arm_of[1])


def screw(arm, stance, name, point):
    """Motion (3, n) of ``point`` (3, n) per unit of a kept slot."""
    slot = arm.slots[arm.names.index(name)]
    axis = stance.axes[name]
    return np.cross(axis, point - stance.origins[name], axis=0) if slot.turns else axis


def _at(R, p, v):
    return p + v[0] * R[0] + v[1] * R[1] + v[2] * R[2]


def _arm(data):
    joints, deg = data["joints"], np.radians
    make = {"dh": _dh_row, "mdh": _mdh_row}[data["convention"]]
    slots = [Slot("base_" + "xyz"[k], False, k) for k in range(3)]
    slots += [Slot("base_r" + "xyz"[k], True, k) for k in range(3)]
    ends = []
    for i, j in enumerate(joints, 1):
        slots += make(
            i, deg(j["alpha_deg"]), j["a_mm"] / 1e3, j["d_mm"] / 1e3, deg(j["theta_deg"]), deg(j.get("beta_deg", 0))
        )
        ends.append(len(slots))
    flange = data.get("flange", {})
    slots += [Slot("flange_" + "xyz"[k], False, k, v / 1e3) for k, v in enumerate(flange.get("position_mm", (0, 0, 0)))]
    rpy = flange.get("rpy_deg", (0, 0, 0))
    slots += [Slot("flange_r" + "xyz"[k], True, k, float(deg(rpy[k]))) for k in (2, 1, 0)]
    slots += [Slot("tool_r" + "xyz"[k], True, k) for k in range(2)]
    n = len(joints)
    couple = np.array([[j.get("couple", {}).get(str(k), 0.0) for k in range(1, n + 1)] for j in joints])
    sense = np.array([float(j.get("sense", 1)) for j in joints])
    zero = np.array([deg(j.get("zero_deg", 0.0)) for j in joints])
    limits = deg(np.array([j["limit_deg"] for j in joints], dtype=float))
    return Arm(
        data["name"], data["convention"], tuple(slots), tuple(ends),
        sense[:, None] * (np.eye(n) + couple), -sense * zero, limits[:, 0], limits[:, 1],
        np.array([j.get("mass_kg", 0.0) for j in joints]),
        np.array([j.get("com_mm", (0, 0, 0)) for j in joints]) / 1e3,
        float(data.get("payload_kg", 5.0)),
    )  # fmt: skip


def _dh_row(i, alpha, a, d, theta, beta):
    tilts = [Slot(f"tilt_x{i}", True, 0), Slot(f"tilt_y{i}", True, 1)]
    turn = [Slot(f"theta{i}", True, 2, theta, i - 1), Slot(f"d{i}", False, 2, d)]
    return [
        *tilts,
        *turn,
        Slot(f"a{i}", False, 0, a),
        Slot(f"alpha{i}", True, 0, alpha),
        Slot(f"beta{i}", True, 1, beta),
    ]


def _mdh_row(i, alpha, a, d, theta, beta):
    k = i - 1
    link = [Slot(f"alpha{k}", True, 0, alpha), Slot(f"a{k}", False, 0, a), Slot(f"beta{k}", True, 1, beta)]
    tilts = [Slot(f"tilt_x{i}", True, 0), Slot(f"tilt_y{i}", True, 1)]
    return [*link, *tilts, Slot(f"theta{i}", True, 2, theta, i - 1), Slot(f"d{i}", False, 2, d)]
