"""Sessions of one arm, each with a fixture, a gauge and a zero of its own: files, made by the generator's own arm.

Nothing here is the product's: the arm walks by ``tests.simulation.generator``, readings are distances.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.identification.worlds import arm_of
from tests.simulation.generator.poses import at_targets, shell_points, toured
from tests.simulation.generator.truth import draw_errors

NAME = "kuka-kr6-r700"
TOOL = np.array([0.030, 0.0, 0.110])
ZERO_SIGMA, PRIOR = 1e-3, 3e-3  # [m] one sigma of a zero, and of where a fixture stands, as the cells say


@dataclass(frozen=True)
class Bench:
    """How a session is measured: kind of gauge, range [m], noise [m], fixture as stated and how far it is off [m]."""

    kind: str = "edbb"
    lengths: tuple[float, float] = (0.30, 0.52)
    noise: float = 2e-6
    fixture: tuple[float, float, float] = (0.430, 0.330, 0.060)
    off: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zero: float = 0.0
    name: str = "A"
    poses: int = 60


BAR_LEFT = Bench(off=(1e-3, -0.6e-3, 0.4e-3), zero=0.3e-3)
BAR_RIGHT = Bench(fixture=(0.400, -0.350, 0.060), off=(-0.7e-3, 0.5e-3, 0.2e-3), zero=-0.2e-3, name="B")
WIRE = Bench("draw-wire", (0.35, 0.90), 50e-6, (0.55, -0.25, 0.02), (0.5e-3, 0.2e-3, -0.4e-3), 0.5e-3, "W")


@dataclass(frozen=True)
class Session:
    """A made session: its bench, its poses (n, N) [rad], its readings (n,) [m], and the folder of its files."""

    bench: Bench
    q: np.ndarray
    length: np.ndarray
    folder: Path

    @property
    def run(self) -> Path:
        """The run."""
        return self.folder / "run.csv"

    @property
    def cell(self) -> Path:
        """The cell."""
        return self.folder / "cell.toml"


@dataclass(frozen=True)
class World:
    """An arm with errors [m, rad]; joints repeat to ``joint`` [rad]."""

    errors: dict[str, float]
    joint: float = 8e-6

    @classmethod
    def drawn(cls, seed: int) -> "World":
        """An arm of its own for each seed."""
        arm = arm_of(NAME)
        return cls({n: e for n, e in draw_errors(arm, np.random.default_rng(seed)).items() if n in arm.names})

    def measure(self, folder: Path, bench: Bench, seed: int, jump: dict[str, float] | None = None) -> Session:
        """Measure a session and write its files; ``jump``: errors [m, rad] that came before it."""
        arm, rng = arm_of(NAME), np.random.default_rng([seed, 31])
        errors = {n: self.errors.get(n, 0.0) + (jump or {}).get(n, 0.0) for n in {*self.errors, *(jump or {})}}
        aim = shell_points(np.array(bench.fixture), np.add(bench.lengths, (8e-3, -8e-3)), bench.poses, rng, 1.2)
        q = at_targets(arm, aim, TOOL, rng)
        q = toured(arm, q[~np.isnan(q[:, 0])])
        shaken = self.joint * rng.standard_normal(q.shape)
        moved = {n: e + shaken[:, int(n[5:]) - 1] if n.startswith("theta") else e for n, e in errors.items()}
        point = walk(q, moved)
        length = np.linalg.norm(point - np.array(bench.fixture) - bench.off, axis=1) + bench.zero
        length = length + bench.noise * rng.standard_normal(len(q))
        folder.mkdir(parents=True, exist_ok=True)
        made = Session(bench, q, length, folder)
        made.run.write_text(_run_text(made))
        made.cell.write_text(_cell_text(bench))
        return made


def walk(q: np.ndarray, errors: dict) -> np.ndarray:
    """Where the tool point comes, (n, 3) [m]."""
    x = arm_of(NAME).walk(q, errors)
    return (x.p + np.einsum("ijn,j->in", x.R, TOOL)).T


def _run_text(made: Session) -> str:
    head = ",".join([*(f"q{i + 1}_deg" for i in range(6)), "length_mm", "fixture", "pose"])
    rows = [
        ",".join([*(f"{v:.7f}" for v in np.degrees(q)), f"{1e3 * length:.6f}", made.bench.name, str(k)])
        for k, (q, length) in enumerate(zip(made.q, made.length, strict=True), 1)
    ]
    return f"# robot: {NAME}\n" + "\n".join([head, *rows]) + "\n"


def _cell_text(bench: Bench) -> str:
    low, high = (round(1e3 * v) for v in bench.lengths)
    place = [round(1e3 * v, 3) for v in bench.fixture]
    return (
        f'schema = "edbb-cell/1"\nrobot = "{NAME}"\nhome_deg = [0, -90, 90, 0, 45, 0]\n\n'
        f"[tool]\nmap_mm = [30, 0, 110]\nmass_kg = 1.3\ncom_mm = [10, 0, 45]\nmap_sigma_um = 10\n\n"
        f'[gauge]\nkind = "{bench.kind}"\nlength_mm = [{low}, {high}]\nnoise_um = {1e6 * bench.noise:g}\n'
        f'zero = "free"\n\n[[fixtures]]\nname = "{bench.name}"\nposition_mm = {place}\nprior_mm = {1e3 * PRIOR:g}\n'
        'set_up = "measured"\n\n[plan]\nfree = ["fixture", "zero"]\n\n[motion]\nmeasure = "static"\n'
    )
