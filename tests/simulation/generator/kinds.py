"""What an effect is, and what the table of kinds says of each kind."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.simulation.generator.arm import Arm


@dataclass(frozen=True)
class Effect:
    """One effect: its kind, the joint (from 1, 0 for none), its size in the kind's unit, and inner numbers.

    With ``share`` given the run chooses the size: what is left of the effect after the geometry has taken what it can
    is then ``share`` times the noise.
    """

    kind: str
    joint: int = 0
    size: float = 0.0
    inner: tuple[tuple[str, float], ...] = ()
    share: float | None = None

    def __getitem__(self, name):
        return dict(self.inner)[name]

    def of_size(self, size):
        """The same effect with another size."""
        return replace(self, size=float(size), share=None)


@dataclass(frozen=True)
class Kind:
    """One row of the table.

    ``moves(scene, effect)``: slot → (n,) motion; ``reads(scene, effect, reading, bar)``: the new reading (n, k), where
    ``bar`` (n, 3) [m] goes from the fixture to the measured point. ``likely``: plausible sizes, for a compliance in rad
    at the joint's reference torque, for a mass in parts of the rated payload. ``inner(rng, arm, joint)`` draws the
    inner numbers. ``right``: labels that count as naming it, besides its own; those in ``right_anywhere`` on any
    joint. ``logs``: what a run must carry to show it. ``absorbed``: lies in the span of geometry and frames, so that
    no fit can show it.
    """

    name: str
    unit: str
    likely: tuple[float, float]
    moves: Callable | None = None
    reads: Callable | None = None
    joints: str = "none"  # none | all | loaded
    inner: Callable[[np.random.Generator, Arm, int], dict] = lambda rng, arm, joint: {}
    in_catalogue: bool = True
    right: tuple[str, ...] = ()
    right_anywhere: tuple[str, ...] = ()
    gauges: tuple[str, ...] = ("edbb", "tracker", "balls")
    motion: tuple[str, ...] = ("static", "continuous")
    logs: tuple[str, ...] = ()
    absorbed: bool = False

    def sizes(self, arm, joint=0):
        """Smallest and largest size that is plausible at a joint of an arm, in the kind's unit."""
        scale = {"rad/Nm": 1 / arm.reference_torque(joint), "kg": arm.payload}.get(self.unit, 1.0)
        return float(self.likely[0] * scale), float(self.likely[1] * scale)

    def places(self, arm):
        """Joints (from 1) where it may sit; joint 0 means nowhere in particular."""
        n = arm.n_joints
        return {"none": (0,), "all": tuple(range(1, n)), "loaded": tuple(range(2, n))}[self.joints]

    def allows(self, gauge, moving):
        """Whether a run of this gauge can show it."""
        return not self.absorbed and gauge in self.gauges and ("continuous" if moving else "static") in self.motion

    def counts_as_right(self, effect, label, joint):
        """Whether naming ``label`` at ``joint`` names this effect rightly."""
        return label in self.right_anywhere or (label in (self.name, *self.right) and joint == effect.joint)
