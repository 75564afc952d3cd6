"""Pictures of the choice: index against number of poses, what the filters leave, what the poses teach."""

from dataclasses import asdict
from itertools import pairwise

import numpy as np

from planner.foresight import Foresight, foreseen
from planner.observability import RULES
from planner.plan import Plan
from planner.report.data import Learnt
from planner.report.picture import BLUE, GREEN, GREY, RED, Limit, Panel, Picture, Series
from planner.report.words import FILTERS, count, sized
from planner.units import to_mm

ROW = 26  # [px] of one name in a list
FEW = 30  # poses, before which errors are off the picture
SHORT = 40  # letters of a label that stand beside an axis


def index_curve(plan: Plan) -> Picture:
    """Index against the number of poses, with the bound that no set of candidates can beat."""
    choice, curve = plan.choice, plan.curve
    rule, n = RULES[choice.index], len(choice.q)
    sizes, values, bounds = (np.asarray(v, float) for v in (curve.sizes, curve.values, curve.bounds))
    hover = tuple(f"{int(k)} poses: {v:.4g}, bound {b:.4g}" for k, v, b in zip(sizes, values, bounds, strict=True))
    series = [
        Series("chosen from the candidates", sizes, values, BLUE, hover=hover),
        Series("proven bound", sizes, bounds, GREY, dashed=True),
        Series(
            f"this plan: {n} poses",
            np.array([n]),
            np.array([choice.value]),
            RED,
            "points",
            hover=(f"{n} poses: {choice.value:.4g}",),
        ),
    ]
    panel = Panel(
        "",
        "number of poses",
        f"{choice.index}, {rule.what}" if len(rule.what) < SHORT else choice.index,
        tuple(series),
        y_range=_room(values, bounds, choice.value),
    )
    better = "higher" if rule.maximise else "lower"
    shared = "" if choice.ball is None else " The plan shares its poses evenly between the balls, the curve does not."
    return Picture(
        "index_curve",
        "How many poses are worth measuring",
        f"{choice.index} ({rule.what}; {better} is better) of the best set found for each number of poses. "
        "No set of the candidates can cross the dashed line, poses moved off the grid can. "
        f"The flatter the curve, the less a further pose brings.{shared}",
        (panel,),
    )


def foresight(ahead: Foresight) -> Picture:
    """Error of the tool that is expected after each number of poses."""
    n = np.arange(1.0, len(ahead.after) + 1)
    hover = tuple(f"{int(k)} poses: {to_mm(e):.3f} mm" for k, e in zip(n, ahead.after, strict=True))
    series = [
        Series("expected once the run is traced", n, to_mm(ahead.after), BLUE, hover=hover),
        Series(
            f"this plan: {len(n)} poses",
            n[-1:],
            np.array([float(to_mm(ahead.left))]),
            RED,
            "points",
            hover=(f"{to_mm(ahead.left):.3f} mm",),
        ),
    ]
    untraced = float(to_mm(ahead.unknown.untraced))
    bound = Limit(float(to_mm(ahead.bound)), f"no {len(n)} poses leave less", below=True)
    limits = (Limit(untraced, "geometry alone"), bound)
    top = 1.5 * max(untraced, float(to_mm(ahead.after[min(len(n), FEW) - 1])))
    panel = Panel("", "number of poses", "error of the tool (mm rms)", tuple(series), limits, y_range=(0.0, top))
    return Picture(
        "foresight",
        "What the robot's error would be",
        f"As the poses of this plan are added: {foreseen(ahead)}.",
        (panel,),
    )


def _room(values: np.ndarray, bounds: np.ndarray, value: float) -> tuple[float, float]:
    both = np.concatenate([values, bounds, [value]])
    both = both[np.isfinite(both)]
    pad = 0.08 * float(np.ptp(both)) + 1e-9
    return float(both.min()) - pad, float(both.max()) + pad


def funnel(plan: Plan) -> Picture:
    """What each filter leaves of the sampled states."""
    counts = [float(v) for v in asdict(plan.pool.funnel).values()]
    texts = [count(counts[0])]
    texts += [f"{count(v)}   {sized(100 * v / u if u else 0.0)} % pass" for u, v in pairwise(counts)]
    bars = Series("", np.array(counts), np.arange(len(counts), dtype=float), BLUE, "bars", texts=tuple(texts))
    panel = Panel(
        "",
        "states that are left (logarithmic scale)",
        "",
        (bars,),
        log_x=True,
        x_range=(1.0, 10.0 ** (np.ceil(np.log10(max(counts[0], 10.0))) + 2)),
        y_names=FILTERS if plan.cell.gauge.is_bar else plan.pool.funnel.names,
        height=ROW * len(counts) + 20,
    )
    return Picture(
        "funnel",
        "From sampled states to candidate poses",
        f"{count(len(plan.pool))} candidates are kept of the states that pass every filter; "
        "the percentage is the part of the row above that passes.",
        (panel,),
    )


def parameters(rows: tuple[Learnt, ...]) -> Picture:
    """Predicted standard deviation of each parameter as a part of its prior size."""
    order = sorted(rows, key=lambda r: r.share)
    share, place = np.array([r.share for r in order]), np.arange(len(order), dtype=float)
    hover = tuple(f"{r.parameter.name}, {r.what}: {r.share:.3g} of the prior size" for r in order)
    points = Series("", share, place, GREEN, "points", hover=hover)
    low = 10.0 ** np.floor(np.log10(share.min()))
    panel = Panel(
        "",
        "predicted standard deviation / prior size",
        "",
        (points,),
        limits=(Limit(1.0, "prior size", upright=True),),
        log_x=True,
        x_range=(low, 10.0 ** np.ceil(np.log10(max(2.0, share.max() * 1.2)))),
        y_names=tuple(r.parameter.name for r in order),
        height=int(0.75 * ROW * len(order)) + 30,
    )
    return Picture(
        "parameters",
        "What the poses teach",
        "Left is well known after the measurement; a parameter at the dotted line stays as uncertain as it was.",
        (panel,),
    )
