"""Pose accuracy and repeatability in the manner of ISO 9283, where a run visits poses several times."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array, in_units, to_mm
from planner.runs.run import Run

FEWEST_VISITS = 3  # of a pose, to say how it scatters
STANDARD_VISITS, STANDARD_POSES = 30, 5  # of the standard's own test
SIGMAS = 3.0


@dataclass(frozen=True)
class PosePerformance:
    """AP and RP of poses that were visited several times (ISO 9283:1998, 7.2.1 and 7.2.2, position alone).

    Attributes:
        visits: of each pose, (k,) int.
        accuracy: AP, distance from where the model has the tool to the barycentre of where it stood, (k,) [m].
        repeatability: RP = l̄ + 3 S_l, of the distances l from the barycentre, (k,) [m].
    """

    visits: np.ndarray
    accuracy: Array
    repeatability: Array

    def text(self) -> str:
        """Return them as a person reads them, in mm."""
        ap, rp = (f"{to_mm(v.mean()):.3f} (largest {to_mm(v.max()):.3f})" for v in (self.accuracy, self.repeatability))
        few = self.visits.min() < STANDARD_VISITS or len(self.visits) < STANDARD_POSES
        rest = f"; the standard asks for {STANDARD_POSES} poses of {STANDARD_VISITS} visits" if few else ""
        seen = f"{len(self.visits)} poses of {self.visits.min()} to {self.visits.max()} visits"
        return f"AP {ap}, RP {rp} mm, in the manner of ISO 9283, {seen}{rest}"

    def section(self) -> dict[str, object]:
        """Return them as a section of ``accuracy.json``."""
        ap, rp = self.accuracy, self.repeatability
        figures = in_units(6, AP_mm=ap.mean(), AP_max_mm=ap.max(), RP_mm=rp.mean(), RP_max_mm=rp.max())
        return {"poses": len(ap), "visits": [int(self.visits.min()), int(self.visits.max())], **figures}


def pose_performance(run: Run, error: Array) -> PosePerformance | None:
    """Return AP and RP of the poses that a tracker saw several times; ``None`` where there is none.

    Args:
        run: with ``pose`` in its samples; scatter is that of the positions as seen, whatever the angles that were read.
        error: seen less model in the base frame, (n, 3) [m].
    """
    pose, seen = run.samples.pose, run.readings.position
    if pose is None or seen is None:
        return None
    visits, ap, rp = list[int](), list[float](), list[float]()
    for p in np.unique(pose[pose >= 0]):
        here = pose == p
        if here.sum() < FEWEST_VISITS:
            continue
        off = np.linalg.norm(seen[here] - seen[here].mean(axis=0), axis=1)
        visits.append(int(here.sum()))
        ap.append(float(np.linalg.norm(error[here].mean(axis=0))))
        rp.append(float(off.mean() + SIGMAS * off.std(ddof=1)))
    return PosePerformance(np.array(visits), np.array(ap), np.array(rp)) if visits else None
