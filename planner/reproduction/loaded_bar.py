"""Section 4.2 of the EDBB paper from simulation: the deflections of eq. 8, the sine of eq. 9, what is left."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fminbound, least_squares

from planner.cell.reading import load_cell
from planner.circular.plan import circle_samples
from planner.circular.planning import CircularSession
from planner.common.progress import Stages
from planner.common.units import MM, UM, Array, to_deg
from planner.loaded.evaluation import evaluate_loaded_circles
from planner.reproduction.published import paper_numbers
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import read_truth

CELL = "abb-irb6700/ldbb"
TRUTH = """schema = "edbb-truth/1"
[errors]
fixture_A_x_mm = {x:.4f}
fixture_A_y_mm = {y:.4f}
theta2_deg = 0.02
theta3_deg = -0.02
theta5_deg = 0.03
a2_mm = 0.2
compliance2_urad_Nm = 0.4
compliance3_urad_Nm = 0.5
compliance5_urad_Nm = 2.0
[noise]
repeatability_mm = 0.02
"""
"""An arm with errors of the usual size, its table ball set off so that the sine has about the paper's size."""


def fit_sine(theta: Array, y: Array) -> tuple[float, float, float, float]:
    """Fit a sin(b θ − φ) to y (n,) [m] at angles θ (n,) [rad] with b free (eq. 9): a [m], b, φ [rad], rms [m].

    For each b the rest is linear, so only b is searched, all over its range; a first guess can end elsewhere.
    """

    def fit(b: float) -> tuple[float, float, float, float]:
        A = np.column_stack([np.sin(b * theta), np.cos(b * theta)])
        (along, across), *_ = np.linalg.lstsq(A, y)
        rms = np.sqrt(np.mean((y - A @ [along, across]) ** 2))
        return float(np.hypot(along, across)), float(b), float(np.arctan2(-across, along)), float(rms)

    best = min(np.arange(0.2, 3.005, 0.01), key=lambda b: fit(b)[3])
    return fit(fminbound(lambda b: fit(b)[3], best - 0.01, best + 0.01, xtol=1e-7))


def fit_from_first_guess(theta: Array, y: Array) -> tuple[float, float, float]:
    """Do the same from the paper's first guess alone: a [m], b, φ [rad]."""
    guess = paper_numbers().first_guess
    start = [guess.a_mm * MM, guess.b, np.radians(guess.phase_deg)]
    found = least_squares(lambda p: p[0] * np.sin(p[1] * theta - p[2]) - y, start, x_scale=[1e-3, 1.0, 1.0])
    a, b, phase = found.x.tolist()
    return a, b, phase


def loaded_numbers() -> dict[str, Any]:
    """Plan, simulate and evaluate the loaded circle; numbers by their keys in the rows."""
    sine = paper_numbers().sine
    lean = 125.0 / np.hypot(125.0, 44.2)  # radius and height of the circle above the table ball [mm]
    offset = sine.a_mm / lean * np.array([np.sin(np.radians(sine.phase_deg)), -np.cos(np.radians(sine.phase_deg))])
    cell = load_cell(CELL)
    driven = CircularSession(cell, 0, {}).drive(Stages())
    samples = circle_samples(driven, 40.0)  # a second: the paper's 1000 only take longer
    with tempfile.TemporaryDirectory() as folder:
        truth = Path(folder) / "truth.toml"
        truth.write_text(TRUTH.format(x=offset[0], y=offset[1]), encoding="utf-8")
        run = simulate_run(driven.cell, "papers", samples, read_truth(truth, driven.cell, samples), seed=1)
    found = evaluate_loaded_circles(run, cell)
    (circle,) = found.circles
    theta, y = circle.curves.theta, circle.averaged.mean(axis=0)
    a, b, phi, rms = fit_sine(theta, y)
    guess = fit_from_first_guess(theta, y)
    shown = slice(None, None, max(1, len(theta) // 90))  # points of the picture
    return {
        "readings_a_turn": 2 * np.pi * circle.curves.circle.radius / 0.05 * 1000,  # 50 mm/s, 1000 Hz
        "spacing_um": 50.0,
        "deflections": circle.curves.deflection.shape[1],
        "deflection_500N_um": float(np.abs(circle.curves.deflection[:, -1]).max()) / UM,
        "spread_um": circle.spread / UM,
        "sine_mm": a / MM, "sine_b": b, "sine_deg": float(to_deg(phi)), "sine_rms_um": rms / UM,
        "sine_b1_mm": circle.offset.amplitude / MM, "sine_b1_deg": float(to_deg(circle.offset.phase)),
        "sine_b1_rms_um": circle.offset.rms / UM,
        "guess_b": guess[1],
        "averaged_deg": np.rad2deg(theta[shown]).tolist(), "averaged_mm": (y[shown] / MM).tolist(),
    }  # fmt: skip
