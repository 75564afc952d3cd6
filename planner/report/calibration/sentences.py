"""What the report says in words; every number in a sentence is one of the calibration's."""

import numpy as np

from planner.identification import Calibration
from planner.report.calibration.data import Told
from planner.report.words import count, sized
from planner.units import Array, to_mm

GROUPS = {
    "pose": ("poses", "whole poses, each with all its repeats"),
    "placement": ("placements", "whole placements of the gauge"),
    "session": ("sessions", "whole sessions"),
    "block": ("blocks", "whole blocks of the run in its order"),
    "stretch": ("stretches", "whole stretches of the drive, never single rows of it"),
}
STRONG, NAMED = 0.9, 6  # correlation worth a sentence, and how many sentences


def mm(value: float) -> str:
    """Write a length [m] in millimetres."""
    return f"{sized(float(to_mm(value)))} mm"


def headline(told: Told) -> tuple[str, ...]:
    """Say what the calibration brought: the sentence that a customer reads; nothing where the fit may not be used."""
    c = told.calibration
    first, before, after = c.stages[0].held_out, told.before.held_out, told.after.held_out
    if c.problems:
        return (
            "No robot was calibrated: the fit failed its own checks.",
            f"It leaves a mean error of {mm(after.mean)} on {GROUPS[c.split_by][0]} that it never saw; that says "
            "nothing of the robot, only of the fit.",
        )
    out = [f"Mean error {mm(before.mean)} → {mm(after.mean)} on {GROUPS[c.split_by][0]} that the fit never saw."]
    factor = before.mean / max(after.mean, 1e-300)
    if factor >= 1.2:
        out.append(
            f"That is {sized(factor, 2)} times less; the largest error fell {_fell(before.largest, after.largest)}."
        )
    elif factor <= 1.0:
        out.append("The calibration brought nothing.")
    if first.mean > 1.05 * before.mean:
        out.append(
            f"The first figure is the robot by its data sheet with only the gauge placed; "
            f"before the gauge's own place was fitted it was {mm(first.mean)}."
        )
    else:
        out.append("The first figure is the robot by its data sheet, with only the gauge placed.")
    if told.before.validation is not None and told.after.validation is not None:
        a, b = told.before.validation.mean, told.after.validation.mean
        out.append(f"On the separate validation run: {mm(a)} → {mm(b)}.")
    return tuple(out)


def _fell(before: float, after: float) -> str:
    return f"from {mm(before)} to {mm(after)}" if after < before else f"not: {mm(before)} before, {mm(after)} now"


def how_held_out(c: Calibration) -> str:
    """Say how samples were kept from the fit that predicts them."""
    several, whole = GROUPS[c.split_by]
    folds = round(1 / c.hold_out)
    out = (
        f"Held out were {whole}: {count(c.n_groups)} {several} in {folds} parts; each part "
        f"was predicted by a fit to the other {folds - 1}. The spread is that of the rms over the parts."
    )
    if c.within is not None:
        out += f" With single poses held out instead, what each of the {several} has of its own being known, the mean "
        out += f"error is {mm(c.within.mean)}."
    return out


def of_noise(told: Told) -> str:
    """Say how large the noise is, as estimated and as repeated readings show it."""
    c = told.calibration
    C = c.fit.problem.whitener.covariance(slice(0, 4096))
    width = min(3, C.shape[1])
    sigma = float(np.sqrt(np.einsum("nii->n", C[:, :width, :width]).mean()))
    out = f"One reading scatters by {mm(sigma)} (standard deviation{' of each axis' if width > 1 else ''}, estimated)"
    if c.noise_floor is not None:
        out += f"; readings repeated at the same pose scatter by {mm(c.noise_floor)}"
    if c.correlation_time > 1.05:
        out += f"; along the drive {sized(c.correlation_time, 2)} samples are worth one"
    return out + "."


def strongest_pairs(names: tuple[str, ...], correlation: Array) -> tuple[str, ...]:
    """Say which parameters the run can hardly tell apart."""
    i, j = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(correlation[i, j]), kind="stable")
    out = []
    for k in order[:NAMED]:
        a, b, rho = names[i[k]], names[j[k]], float(correlation[i[k], j[k]])
        if abs(rho) < STRONG:
            break
        better = "difference" if rho > 0 else "sum"
        out.append(
            f"{a} and {b} ({rho:+.3f}): counted in their own standard deviations, the run knows their {better} "
            f"{sized(1 / np.sqrt(max(1 - abs(rho), 1e-12)), 2)} times better than if they were independent."
        )
    if not out and len(order):
        k = order[0]
        rho = float(correlation[i[k], j[k]])
        out.append(
            f"No two parameters hang closely together; the closest are {names[i[k]]} and {names[j[k]]} ({rho:+.2f})."
        )
    return tuple(out)


def refused(c: Calibration) -> tuple[str, ...]:
    """Return the reasons not to use the result: one sentence, or one that announces them and one for each."""
    if len(c.problems) < 2:
        return tuple(f"Not to be used, because {p}." for p in c.problems)
    return (f"Not to be used, for {len(c.problems)} reasons:", *(f"{p}." for p in c.problems))
