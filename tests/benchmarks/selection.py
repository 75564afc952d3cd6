"""What selection reaches and costs: ``python -m tests.benchmarks.selection [--without-figaroh] [--small]``.

Prints the certified gaps of both kinds of cell, times, growth with candidates and poses, and FIGAROH 1.0.2's Detmax and
SOCPOptimizer on the same rows in the same run (installed in an environment of its own in the cache folder). Wall
and processor seconds are both given: on a busy machine only the second repeats.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

import numpy as np

import tests.design.observability.dh_arm as dh_arm
from planner.design.observability.identifiability import find_identifiable
from planner.design.observability.information import index_value
from planner.design.off_grid import refine_off_grid
from planner.design.selection.d_optimal import detmax
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_search import compute_index_curve, exchange_poses
from planner.design.selection.pruning import prune_poses
from tests.design.observability.dh_arm import NJ130

CELLS = {"paper": ((), ()), "edbb": ((2,), ("fixture", "tool", "zero"))}


def timed(function, *args, **settings):
    """(result, wall s, processor s)."""
    wall, cpu = time.perf_counter(), time.process_time()
    out = function(*args, **settings)
    return out, time.perf_counter() - wall, time.process_time() - cpu


def rows_of(cell, q):
    """Identifiable columns of a cell's length rows (n, 1, P)."""
    beta, free = CELLS[cell]
    kept = find_identifiable(dh_arm.rows(NJ130, q[:4_000], beta, free), dh_arm.names(NJ130, beta, free)).kept
    return dh_arm.rows(NJ130, q, beta, free)[..., list(kept)]


def gaps(q, pools, sizes):
    print("\n| cell | candidates | P | poses | bound O2 | slack | s (cpu) | reached | gap | s (cpu) | pruned |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for cell in CELLS:
        for count in pools:
            rows = rows_of(cell, q[:count])
            for n in sizes:
                c, wall, cpu = timed(certify_bound, rows, "O2", n)
                s, wall_s, cpu_s = timed(exchange_poses, rows, n, "O2", certificate=c)
                pruned = index_value("O2", rows[prune_poses(rows, n)])
                head = (
                    f"| {cell} | {count} | {rows.shape[2]} | {n} | {c.value:.3f} | {abs(c.relaxed / c.value - 1):.1e} "
                )
                print(
                    f"{head}| {wall:.1f} ({cpu:.1f}) | {s.value:.3f} | {100 * s.gap:.2f} % "
                    f"| {wall_s:.1f} ({cpu_s:.1f}) | {pruned:.2f} |",
                    flush=True,
                )


def refinement(q):
    rows = rows_of("paper", q)
    s = exchange_poses(rows, 35, starts=1)
    kept = list(find_identifiable(dh_arm.rows(NJ130, q[:4_000]), dh_arm.names(NJ130)).kept)
    low, high = np.radians(NJ130.lower), np.radians(NJ130.upper)

    def valid(t, _):
        reading = dh_arm.length(NJ130, t)
        inside = ((t >= low) & (t <= high)).all(axis=1)
        return inside & (reading > NJ130.shell[0]) & (reading < NJ130.shell[1])

    moved, wall, cpu = timed(refine_off_grid, q[s.chosen], lambda t, _: dh_arm.rows(NJ130, t)[..., kept], valid)
    before, after = (index_value("O2", dh_arm.rows(NJ130, t)[..., kept]) for t in (q[s.chosen], moved))
    print(f"\nrefinement of 35 poses off the grid: {before:.3f} to {after:.3f} in {wall:.1f} s ({cpu:.1f} cpu)")


def curve(q):
    sizes = [22, 25, 30, 35, 45, 60, 80, 120, 200]
    c, wall, cpu = timed(compute_index_curve, rows_of("paper", q), sizes)
    print(f"\nindex curve over {len(q)} candidates in {wall:.1f} s ({cpu:.1f} cpu), bends at {c.knee}")
    for n, value, least in zip(c.sizes, c.values, c.bounds, strict=True):
        print(f"  {n:4d} poses  O2 {value:7.3f}  bound {least:7.3f}  gap {100 * (value / least - 1):5.2f} %")


def growth(q, counts, sizes):
    """Processor seconds and the exponent of a straight line on logarithmic axes."""
    table = {}
    for count in counts:
        pool = np.resize(q, (count, q.shape[1])) if count <= len(q) else dh_arm.shell_poses(NJ130, count, seed=9)
        rows = rows_of("paper", pool)
        c, _, table["bound", count] = timed(certify_bound, rows, "O2", 60)
        _, _, table["exchange", count] = timed(exchange_poses, rows, 60, certificate=c, starts=1)
        _, _, table["detmax", count] = timed(detmax, rows, 60, starts=1)
        _, _, table["prune", count] = timed(prune_poses, rows, 60)
    rows = rows_of("paper", q[:20_000])
    by_size = {}
    for n in sizes:
        c, _, by_size["bound", n] = timed(certify_bound, rows, "O2", n)
        _, _, by_size["exchange", n] = timed(exchange_poses, rows, n, certificate=c, starts=1)
        _, _, by_size["detmax", n] = timed(detmax, rows, n, starts=1)
    _growth_table("candidates (60 poses)", table, counts)
    _growth_table("poses (20 000 candidates)", by_size, sizes)


def _growth_table(title, table, at):
    print(f"\n| {title}, cpu s | " + " | ".join(map(str, at)) + " | exponent |")
    print("|---" * (len(at) + 2) + "|")
    for name in dict.fromkeys(key for key, _ in table):
        seconds = [table[name, k] for k in at]
        slope = np.polyfit(np.log(at), np.log(seconds), 1)[0]
        print(f"| {name} | " + " | ".join(f"{s:.2f}" for s in seconds) + f" | {slope:.2f} |")


# Its Detmax documents ``cur_set`` as the result but leaves it empty: the set is taken from its last criterion instead.
# It may take a pose more than once (its pool is never reduced), so the number of distinct poses is printed as well.
_PEER = """
import json, sys, time, random
import numpy as np
from figaroh.optimal.base_optimal_calibration import Detmax, SOCPOptimizer
rows, n, seed = np.load(sys.argv[1])["rows"], int(sys.argv[2]), int(sys.argv[4])
info = {k: r.T @ r for k, r in enumerate(rows)}
random.seed(seed)

class Watched(Detmax):
    def get_critD(self, chosen):
        self.last = list(chosen)
        return super().get_critD(chosen)

wall, cpu = time.perf_counter(), time.process_time()
own = None
if sys.argv[3] == "detmax":
    peer = Watched(info, n)
    own = float(peer.main_algo()[-1])
    chosen = peer.last
else:
    chosen = list(SOCPOptimizer(info, {"NbSample": len(rows)}).solve()[1])[:n]
wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
print(json.dumps({"chosen": [int(k) for k in chosen], "own": own, "wall": wall, "cpu": cpu}))
"""


def peer(q):
    python = _peer_python()
    rows, n = rows_of("paper", q[:500]), 60
    scale = np.sqrt(np.mean(rows**2, axis=(0, 1)))

    def score(chosen):  # det^(1/P) of the information, columns in their own size
        tall = rows[chosen, 0] / scale
        return float(np.exp(np.linalg.slogdet(tall.T @ tall)[1] / rows.shape[2]))

    best = certify_bound(rows / scale, "O1", n).value ** 2 * n
    print(f"\n500 candidates, 60 poses, {rows.shape[2]} parameters: det^(1/P), no set above {best:.4f}")
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "rows.npz", rows=rows / scale)
        for kind, seed in (("detmax", 0), ("detmax", 1), ("detmax", 2), ("socp", 0)):
            call = [python, "-c", _PEER, str(Path(folder) / "rows.npz"), str(n), kind, str(seed)]
            done = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
            if done.returncode:
                print(f"  FIGAROH {kind}: failed: {done.stderr.strip().splitlines()[-1]}")
                continue
            found = json.loads(done.stdout.strip().splitlines()[-1])
            reached = score(found["chosen"])
            if len(found["chosen"]) != n or (found["own"] and abs(found["own"] / reached - 1) > 1e-6):
                raise SystemExit(
                    f"FIGAROH {kind} is read wrongly: {len(found['chosen'])} poses, {found['own']}, {reached}"
                )
            print(
                f"  FIGAROH {kind} (seed {seed})  {reached:.4f}  {found['wall']:.2f} s ({found['cpu']:.2f} cpu)"
                f"  {len(set(found['chosen']))} distinct poses"
            )
    ours = {"detmax": lambda: detmax(rows, n), "exchange": lambda: exchange_poses(rows, n, "O1", starts=1).chosen}
    for name, call in ours.items():
        chosen, wall, cpu = timed(call)
        print(
            f"  ours    {name}  {score(chosen):.4f}  {wall:.2f} s ({cpu:.2f} cpu)  {len(set(chosen.tolist()))} distinct"
        )
    many = rows_of("paper", q[:20_000])
    _, wall, cpu = timed(detmax, many, n)
    print(f"  ours    detmax over 20 000 candidates: {wall:.2f} s ({cpu:.2f} cpu)")


def _peer_python():
    """Python of an environment with FIGAROH in it, made once, beside the repository's own (git ignores both)."""
    folder = Path(__file__).parents[2] / ".venv" / "figaroh-1.0.2"
    python = folder / "bin" / "python"
    if not (folder / "ready").exists():
        print("\ninstalling FIGAROH 1.0.2 (about two minutes) ...", flush=True)
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "figaroh==1.0.2"], check=True)
        (folder / "ready").touch()
    return str(python)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without-figaroh", action="store_true")
    parser.add_argument("--small", action="store_true", help="pools up to 20 000 candidates")
    settings = parser.parse_args()
    top = 20_000 if settings.small else 100_000
    q, wall, _ = timed(dh_arm.shell_poses, NJ130, top, 1)
    print(
        f"numpy {np.__version__}, Python {sys.version.split()[0]}, {os.cpu_count()} cores; {top} poses in {wall:.0f} s"
    )
    if not settings.without_figaroh:
        peer(q)
    gaps(q, (5_000, top), (35, 60, 100))
    refinement(q[:5_000])
    curve(q)
    growth(q, (1_000, 10_000, top) if settings.small else (1_000, 10_000, 100_000, 1_000_000), (25, 50, 100, 200, 500))


if __name__ == "__main__":
    main()
