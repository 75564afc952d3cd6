"""Whether a calibrated robot is worse than the nominal one: what a person must read before anything else."""

from collections.abc import Iterator, Sequence

from planner.common.units import MM
from planner.model.identification_document import Metrics, Release, Stage


def worse_than_nominal(stages: Sequence[Stage], release: Release | None, anywhere: float, unit: str) -> str | None:
    """Return the sentence that says in what the robot that is written is worse than the nominal one; else ``None``.

    Judged are the tool's error over the workspace, and the errors of the samples that no fit saw, against the nominal
    robot with the gauge placed for it.

    Args:
        stages: of the fit, in order.
        release: what is written, ``None`` where that is the last stage.
        anywhere: error of its tool over the workspace, rms [m].
        unit: what a thousandth of a reading is called, ``mm`` or ``mrad``.
    """
    larger = _larger_errors(stages, release, anywhere, unit)
    digits = ((what, f"{before / MM:.3f}", f"{after / MM:.3f}", shown) for what, before, after, shown in larger)
    figures = [f"{what} {before} → {after} {shown}" for what, before, after, shown in digits if before != after]
    if not figures:
        return None
    return f"WORSE THAN THE NOMINAL ROBOT, do not use it: {', '.join(figures)} (rms)"


def _larger_errors(
    stages: Sequence[Stage], release: Release | None, anywhere: float, unit: str
) -> Iterator[tuple[str, float, float, str]]:
    """Yield what has grown, before and after [m, rad], and what a thousandth of it is called."""
    if release is not None and anywhere > release.nominal_anywhere:
        yield "error over the workspace", release.nominal_anywhere, anywhere, "mm"
    # 1: position of the stage of the nominal robot, its gauge placed as well as may be
    nominal, now = stages[min(1, len(stages) - 1)], stages[-1] if release is None else release
    pairs: tuple[tuple[str, Metrics | None, Metrics | None], ...] = (
        ("held-out samples", nominal.held_out, now.held_out),
        ("validation", nominal.validation, now.validation),
    )
    for what, before, after in pairs:
        if before is not None and after is not None and after.rms > before.rms:
            yield what, before.rms, after.rms, unit
