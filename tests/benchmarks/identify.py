"""What a fit costs: ``python -m tests.benchmarks.identify [--small]``.

(a) 42 parameters on 200 lengths, beside ``scipy.optimize.least_squares`` with numeric derivatives on the same residual.
(b) A million rows of a continuous run, 35 parameters: seconds and peak memory, each in a process of its own.
Wall and processor seconds are both given: on a busy machine only the second repeats.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.effects.compliance import compliance_parameters
from planner.fit.identifiable_parameters import identifiable_subset
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.identification.pipeline import identify
from planner.model.model import Model
from planner.runs.run import Readings, Run, Samples

GOALS = {"small": 20e-3, "seconds": 20.0, "gigabytes": 2.0}
PLACES = (
    (258, 1468, 708),
    (1300, 900, 400),
    (1500, -700, 500),
    (200, -1500, 900),
    (1700, 100, 1300),
    (900, 1300, 1500),
)
CELL = """schema = "edbb-cell/1"
robot = "comau-nj130"
home_deg = [0, 0, 0, 0, -90, 0]
[tool]
map_mm = [50, 0, 150]
mass_kg = 5
com_mm = [15, 0, 60]
[gauge]
kind = "edbb"
noise_um = 3
length_mm = [300, 520]
"""


def cell_with(places: int):
    """The NJ-130 with so many fixtures around it."""
    text = CELL + "".join(
        f'[[fixtures]]\nname = "{"ABCDEF"[k]}"\nposition_mm = {list(PLACES[k])}\n' for k in range(places)
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        path.write_text(text)
        return load_cell(str(path), planning=False)


def whole(cell) -> Model:
    model = Model.of(setup_of(cell), cell.plan.free)
    return model.plus(compliance_parameters(model.setup))


def measured(model: Model, samples: Samples, rng) -> Run:
    """A run of a robot whose parameters are off by a third of their prior sigmas."""
    errors = 0.3 * model.prior * rng.standard_normal(len(model.names))
    there = Readings(length=np.zeros(len(samples)))
    clean = -model.residual(samples, model.setup.targets(samples, there), errors)[:, 0]
    length = clean + model.noise(samples.take(slice(1)))[0] * rng.standard_normal(len(samples))
    return Run("made", samples, Readings(length=length), model.setup.place_names, continuous=samples.t is not None)


def poses(places: int, n: int, rng) -> Samples:
    robot = cell_with(1).robot
    return Samples(rng.uniform(robot.q_lower, robot.q_upper, (n, 6)), np.arange(n) % places)


def path(places: int, n: int, rng) -> Samples:
    """Joints that swing smoothly, one fixture after the other; 100 samples a second."""
    robot = cell_with(1).robot
    t = np.arange(n) * 1e-2
    middle, half = (robot.q_upper + robot.q_lower) / 2, (robot.q_upper - robot.q_lower) / 2
    turns = rng.uniform(0.02, 0.09, 6) + 3.0 / t[-1]
    q = middle + 0.8 * half * np.sin(2 * np.pi * turns * t[:, None] + rng.uniform(0, 6, 6))
    return Samples(q, np.arange(n) * places // n, t=t)


def timed(call, repeats=1):
    """Result, and least wall and processor seconds."""
    wall, cpu = [], []
    for _ in range(repeats):
        w, c = time.perf_counter(), time.process_time()
        out = call()
        wall.append(time.perf_counter() - w)
        cpu.append(time.process_time() - c)
    return out, min(wall), min(cpu)


def small() -> None:
    rng, places, wanted = np.random.default_rng(1), 6, 42
    samples = poses(places, 200, rng)
    model = identifiable_subset(whole(cell_with(places)), samples)[0]
    model = model.subset(list(range(len(model.names)))[-wanted:])
    run = measured(model, samples, rng)
    print(f"\n{len(model.names)} parameters on {len(run)} lengths")
    found, first, first_cpu = timed(lambda: fit(FitProblem.of(model, run)))
    _, wall, cpu = timed(lambda: fit(FitProblem.of(model, run)), 9)
    print(f"  fit, first after import       {first * 1e3:8.1f} ms ({first_cpu * 1e3:.1f} cpu)")
    print(
        f"  fit, best of nine             {wall * 1e3:8.1f} ms ({cpu * 1e3:.1f} cpu); goal {GOALS['small'] * 1e3:.0f}"
    )
    problem = found.problem

    def residual(z):
        return np.append(problem.white_residual(z * problem.prior).ravel(), z)

    peer, wall, cpu = timed(lambda: least_squares(residual, np.zeros(len(problem.prior)), x_scale="jac", method="lm"))
    off = np.max(
        np.abs(peer.x * problem.prior - found.errors) / np.sqrt((found.solution.root(problem.prior) ** 2).sum(1))
    )
    print(f"  scipy least_squares, numeric  {wall * 1e3:8.1f} ms ({cpu * 1e3:.1f} cpu), {peer.nfev} evaluations;")
    print(f"      largest difference of a parameter {off:.1e} of its standard deviation (noise and priors given to it)")


def large(rows: int, what: str) -> None:
    """One measurement, printed as JSON: in a process of its own."""
    rng, places = np.random.default_rng(2), 3
    cell = cell_with(places)
    samples = path(places, rows, rng)
    model = identifiable_subset(whole(cell), samples)[0]
    run = measured(model, samples, rng)
    before = peak()
    if what == "fit":
        out, wall, cpu = timed(lambda: fit(FitProblem.of(model, run)))
        count = len(out.errors)
    elif what == "identify":
        out, wall, cpu = timed(lambda: identify(run, cell))
        count = len(out.fit.errors)
    else:
        _, wall, cpu, count = None, 0.0, 0.0, len(model.names)
    print(json.dumps({"wall": wall, "cpu": cpu, "peak": peak(), "before": before, "parameters": count}))


def peak() -> float:
    """Largest resident memory so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def growth(sizes) -> None:
    print("\n| rows | what | parameters | s | cpu s | peak GB | before it began |")
    print("|---|---|---|---|---|---|---|")
    for rows in sizes:
        for what in ("fit", "identify"):
            call = [sys.executable, "-m", "tests.benchmarks.identify", "--one", what, "--rows", str(rows)]
            done = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
            if done.returncode:
                print(f"| {rows} | {what} | failed: {done.stderr.strip().splitlines()[-1]} |")
                continue
            d = json.loads(done.stdout.strip().splitlines()[-1])
            print(
                f"| {rows} | {what} | {d['parameters']} | {d['wall']:.1f} | {d['cpu']:.1f} "
                f"| {d['peak']:.2f} | {d['before']:.2f} |",
                flush=True,
            )
    print(f"goals at a million rows: {GOALS['seconds']:.0f} s, {GOALS['gigabytes']:.0f} GB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="no more than 100 000 rows")
    parser.add_argument("--one", choices=("fit", "identify"))
    parser.add_argument("--rows", type=int, default=1_000_000)
    settings = parser.parse_args()
    if settings.one:
        large(settings.rows, settings.one)
        return
    machine = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    print(f"numpy {np.__version__}, Python {sys.version.split()[0]}, {machine}")
    small()
    growth((30_000, 100_000) if settings.small else (100_000, 300_000, 1_000_000))


if __name__ == "__main__":
    main()
