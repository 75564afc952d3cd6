"""What is released and stated with some wild rows against without them: ``python -m tests.benchmarks.wild_rows LOG``.

Each arm is measured once by means that share no code with the planner, with hidden causes; then some of its rows are
put off by as many millimetres, a tracker's in a direction of their own. Both runs are identified. One line of LOG an
arm; what stands there is not done again, so that it can be stopped::

    python -m tests.benchmarks.wild_rows LOG.jsonl --arms 20 --worlds bar,tracker --off 0.3-1,5,50
    python -m tests.benchmarks.wild_rows LOG.jsonl --table
"""

import argparse
import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import numpy as np

from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import calibrated_files
from planner.documents.calibration import Calibration
from planner.identification.pipeline import identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.blind import workspace
from tests.independent_arms import runs as own_runs
from tests.independent_arms.arm import make_arm
from tests.independent_arms.judge import evaluation_states, model_error
from tests.simulation.generator import runs
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.truth import draw_truth

COUNTS = (0, 1, 2, 3)  # of hidden causes, taken in turn
SHARE = 0.03  # of rows that are wild


@dataclass(frozen=True)
class Measured:
    """A run as text, the text of its cell (or its path), and what judges a calibration: true rms error [mm]."""

    run: str
    cell: str | Path
    judge: Callable[[Calibration, Path], float]


def written(found: Calibration, folder: Path) -> Path:
    """Write the released robot; return its file."""
    for name, text in calibrated_files(found):
        (folder / name).write_text(text)
    return folder / "robot.toml"


def of_own_arm(gauge: str, seed: int) -> Measured:
    """The arm of ``tests.independent_arms``, by a bar or a tracker."""
    true, session = make_arm(seed, gauge, COUNTS[seed % len(COUNTS)], False), own_runs.Session(gauge)
    columns = session.measure(true)
    q, condition = evaluation_states(true.arm, seed), own_runs.middle(columns["t_s"])
    with tempfile.TemporaryDirectory() as folder:
        own_runs.write_run(columns, Path(folder) / "run.csv")
        text = (Path(folder) / "run.csv").read_text()
    return Measured(
        text, own_runs.CELLS[gauge], lambda found, to: model_error(true, q, written(found, to), to, condition)[0]
    )


def of_generator(build, name: str, gauge: str, seed: int) -> Measured:
    """A shipped arm of the generator with hidden effects."""
    arm, bench, rng = Arm.from_toml(name), BENCHES[name], np.random.default_rng([seed, 8])
    hidden = workspace.hidden_effects(arm, rng, COUNTS[seed % len(COUNTS)], False)
    scale = workspace.gauge_scale(workspace.Task(gauge, "", 0, False, seed))
    made = build(arm, n_poses=110, seed=seed, truth=draw_truth(arm, seed, [*hidden, scale]), logs=())
    q = workspace.states_anywhere(arm, bench, rng)
    true = workspace.true_tool(arm, bench, made.truth, q)

    def judge(found: Calibration, folder: Path) -> float:
        off = workspace.difference(workspace.released_tool(found, bench, folder, q), true)
        return 1e3 * float(np.sqrt((off**2).sum(axis=1).mean()))

    return Measured(made.run_csv, made.cell_toml, judge)


def of_wires(seed: int) -> Measured:
    """The same, its lengths read by a draw wire."""
    measured = of_generator(runs.edbb_static, "abb-irb120", "edbb", seed)
    assert isinstance(measured.cell, str)
    return replace(measured, cell=measured.cell.replace('kind = "edbb"', 'kind = "draw-wire"'))


WORLDS: dict[str, Callable[[int], Measured]] = {
    "bar": lambda seed: of_own_arm("bar", seed),
    "tracker": lambda seed: of_own_arm("tracker", seed),
    "kr6-tracker": lambda seed: of_generator(runs.tracker, "kuka-kr6-r700", "tracker", seed),
    "ur10-bar": lambda seed: of_generator(runs.edbb_static, "ur10", "edbb", seed),
    "wire": of_wires,
}


def spoil(text: str, off: tuple[float, float], seed: int, share: float = SHARE) -> tuple[str, list[int]]:
    """Return the run with rows put off by a length drawn from ``off`` [mm], either way, and which, from 0."""
    rng = np.random.default_rng([seed, 33])
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    names, rows = lines[first].split(","), [line.split(",") for line in lines[first + 1 :]]
    at = [k for k, n in enumerate(names) if n in ("length_mm", "x_mm", "y_mm", "z_mm")]
    wild = sorted(rng.choice(len(rows), max(1, round(share * len(rows))), replace=False).tolist())
    for k in wild:
        way = rng.standard_normal(len(at))
        way *= np.exp(rng.uniform(*np.log(off))) / np.linalg.norm(way)
        for column, by in zip(at, way, strict=True):
            rows[k][column] = f"{float(rows[k][column]) + by:.6f}"
    return "\n".join([*lines[: first + 1], *(",".join(r) for r in rows)]) + "\n", wild


def without(text: str, gone: list[int]) -> str:
    """Return the run without some rows, from 0."""
    lines = text.splitlines(keepends=True)
    first = 1 + next(k for k, line in enumerate(lines) if not line.startswith("#"))
    return "".join(line for k, line in enumerate(lines) if k - first not in gone)


def figures(measured: Measured, text: str) -> dict:
    """Identify a run; return true error, what is stated and the 95 % bound [mm]."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "run.csv").write_text(text)
        cell = measured.cell
        if isinstance(cell, str):
            (folder / "cell.toml").write_text(cell)
            cell = folder / "cell.toml"
        where = load_cell(str(cell), planning=False)
        found = identify(load_runs([folder / "run.csv"], where.robot.n_joints), where, tracer=trace)
        return {
            "true": measured.judge(found, folder),
            "stated": 1e3 * found.workspace_error,
            "bound": 1e3 * found.release.at_most if found.release else float("nan"),
            "held_out": 1e3 * found.written_stage.held_out.rms,
            "findings": "; ".join(f"{f.effect}, {f.on}" for c in found.findings for f in c.each),
            "outliers": found.outliers.tolist(),
        }


def compare(world: str, seed: int, off: tuple[float, float]) -> dict:
    """Identify an arm without wild rows and with some."""
    measured = WORLDS[world](seed)
    text, wild = spoil(measured.run, off, seed)
    return {
        "world": world, "seed": seed, "off": list(off), "rows": wild,
        "without": figures(measured, without(measured.run, wild)), "with": figures(measured, text),
    }  # fmt: skip


def table(lines: list[dict]) -> str:
    """Return ratios of what is had with wild rows to what is had without, by how far they are off, and by world."""
    out = [f"{'':24}{'arms':>5}" + "".join(f"{k:>26}" for k in ("true", "stated", "bound"))]
    out.append(f"{'':29}" + f"{'median   90 %   mean mm':>26}" * 3)
    kinds = {(tuple(r["off"]), w) for r in lines for w in (r["world"], "all")}
    for off, world in sorted(kinds):
        own = [r for r in lines if tuple(r["off"]) == off and world in (r["world"], "all")]
        row = f"{'-'.join(f'{v:g}' for v in dict.fromkeys(off)) + ' mm, ' + world:24}{len(own):5}"
        for key in ("true", "stated", "bound"):
            a, b = (np.array([r[k][key] for r in own], dtype=float) for k in ("without", "with"))
            row += f"{np.nanmedian(b / a):9.3f}{np.nanquantile(b / a, 0.9):7.3f}{np.nanmean(b):10.4f}"
        out.append(row)
    return "\n".join(out)


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.wild_rows", description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("--arms", type=int, default=20, help="of each world")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--worlds", default=",".join(WORLDS))
    parser.add_argument("--off", default="0.3-1,5,50", help="mm, each arm takes the next")
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    lines = [json.loads(line) for line in given.log.read_text().splitlines()] if given.log.exists() else []
    if not given.table:
        done = {(r["world"], r["seed"], tuple(r["off"])) for r in lines}
        offs = [tuple(float(v) for v in part.split("-")) for part in given.off.split(",")]
        for k in range(given.arms):
            for world in given.worlds.split(","):
                seed, off = given.first_seed + k, offs[k % len(offs)]
                off = (off[0], off[-1])
                if (world, seed, off) in done:
                    continue
                lines.append(compare(world, seed, off))
                with given.log.open("a") as file:
                    file.write(json.dumps(lines[-1]) + "\n")
    print(table(lines))


if __name__ == "__main__":
    main()
