"""Arms that a table of Denavit and Hartenberg's numbers describes, without masses: few families of effects, all act.

Every gear errs and one axis has play. The readings are made by the table's own product of matrices.
"""

import re

import numpy as np
import pytest

from planner.common.finite_documents import check_finite
from planner.workflow.identification import identify

# alpha [deg], a, d [mm], theta [deg]
TABLES = {
    "six axes": [
        (-90, 155, 450, 0), (0, 614, 0, -90), (-90, 200, 0, 0), (90, 0, 640, 0), (-90, 0, 0, 0), (0, 0, 100, 180),
    ],
    "seven axes": [
        (-90, 0, 360, 0), (90, 0, 0, 0), (90, 0, 420, 0), (-90, 0, 0, 0),
        (-90, 0, 400, 0), (90, 0, 0, 0), (0, 0, 126, 0),
    ],
    "parallel axes": [
        (90, 0, 162, 0), (0, -425, 0, 0), (0, -392, 0, 0), (90, 0, 133, 0), (-90, 0, 100, 0), (0, 0, 100, 0),
    ],
}  # fmt: skip
TOOL, FIXTURE = np.array([0.05, 0.0, 0.12]), np.array([0.6, 0.2, 0.1])  # [m]
NOISE = {"tracker": 30e-6, "edbb": 3e-6, "draw-wire": 50e-6}  # [m]
LENGTHS = {"edbb": (0.3, 0.7), "draw-wire": (0.3, 1.2)}  # [m]
CELL = 'schema = "edbb-cell/1"\nrobot = "arm.csv"\n[gauge]\nkind = "{}"\nnoise_um = {:g}\n'
AT_FIXTURE = (
    'length_mm = [200, 1400]\n[[fixtures]]\nname = "A"\nposition_mm = [600, 200, 100]\n[tool]\nmap_mm = [50, 0, 120]\n'
)


def tool_point(table, q):
    """Where the tool comes, (n, 3) [m]; ``table`` (N, 4): alpha, a, d, theta in SI units."""
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for (alpha, a, d, theta), angle in zip(table, q.T, strict=True):
        c, s, ca, sa = np.cos(theta + angle), np.sin(theta + angle), np.cos(alpha), np.sin(alpha)
        step = np.zeros((len(q), 4, 4))
        step[:, 0] = np.stack([c, -s * ca, s * sa, a * c], axis=1)
        step[:, 1] = np.stack([s, c * ca, -c * sa, a * s], axis=1)
        step[:, 2:] = [[0, sa, ca, d], [0, 0, 0, 1]]
        T = T @ step
    return (T @ np.append(TOOL, 1.0))[:, :3]


def measured(folder, name, kind, poses, seed):
    """Write robot, cell and run of an arm whose gears err; return run and cell."""
    rng = np.random.default_rng(seed)
    rows = np.array(TABLES[name], dtype=float)
    nominal = np.column_stack([np.radians(rows[:, 0]), 1e-3 * rows[:, 1:3], np.radians(rows[:, 3])])
    true = nominal + rng.normal(0.0, 5e-4, nominal.shape)
    q = rng.uniform(-2.2, 2.2, (poses if kind == "tracker" else 200 * poses, len(rows)))
    if kind != "tracker":
        length = np.linalg.norm(tool_point(nominal, q) - FIXTURE, axis=1)
        q = q[(length > LENGTHS[kind][0]) & (length < LENGTHS[kind][1])][:poses]
    stands = q + 2e-4 * np.sin(q + rng.uniform(0, 6, q.shape[1])) + 1e-4 * np.sin(2 * q)
    stands[:, 1] += 7e-5 * np.sign(np.diff(q[:, 1], prepend=0.0))
    p = tool_point(true, stands + rng.normal(0.0, 8e-6, q.shape))
    if kind == "tracker":
        turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
        reading, columns = (p - [2.5, -0.5, 0.8]) @ turn, ["x_mm", "y_mm", "z_mm"]
    else:
        reading, columns = np.linalg.norm(p - FIXTURE - [1e-3, -5e-4, 3e-4], axis=1)[:, None], ["length_mm"]
    reading = 1e3 * (reading + rng.normal(0.0, NOISE[kind], reading.shape))
    heads = [*(f"cmd{k + 1}_deg" for k in range(len(rows))), *columns]
    table = np.column_stack([np.degrees(q), reading])
    np.savetxt(folder / "run.csv", table, fmt="%.6f", delimiter=",", header=",".join(heads), comments="")
    lines = "\n".join(",".join(f"{v:g}" for v in row) for row in rows)
    (folder / "arm.csv").write_text(f"# convention: dh\nalpha_deg,a_mm,d_mm,theta_deg\n{lines}\n")
    text = CELL.format(kind, 1e6 * NOISE[kind]) + ("" if kind == "tracker" else AT_FIXTURE)
    (folder / "cell.toml").write_text(text)
    return folder / "run.csv", folder / "cell.toml"


def check_all(found, folder):
    """All documents and the screen are of finite numbers; each probability is one."""
    for path in found.write(folder):
        check_finite(path, path.read_bytes())
    assert not {"nan", "inf"} & set(re.findall(r"\w+", found.full_summary(verbose=True).lower()))
    for finding in found.calibration.findings:
        assert 0 <= finding.probability <= 1
        assert all(0 <= p <= 1 for p in finding.rival_probabilities or ())


@pytest.mark.long
@pytest.mark.parametrize("kind", NOISE)
@pytest.mark.parametrize("name", TABLES)
def test_every_gauge_on_arms_without_masses(name, kind, tmp_path):
    run, cell = measured(tmp_path, name, kind, 70 if kind == "tracker" else 140, 4)
    found = identify(run, cell=cell)
    assert found.calibration.findings
    check_all(found, tmp_path / "out")
