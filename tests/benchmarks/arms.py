"""Any arm with any gauge, planned and identified: ``python -m tests.benchmarks.arms LOG.jsonl [--packages DIR …]``.

Every shipped robot, and ten by the URDF of packages that were made for that (``pip download example-robot-data
rtb-data==1.0.1``, unpacked below DIR), each with a bar, a draw wire, a tracker and a plate with sockets that stand
where the arm reaches well. Each plan runs in a process of its own under ``--limit``; then an arm with drawn geometric
errors, by means that share no code with the planner, is measured and identified from it. One line of LOG a case; what
stands there is not done again. ``--only WORD …`` takes the cases whose name holds one of the words, ``--table`` only
prints.

An arm that is refused because crude bodies of its URDF touch is planned again with the cure that the refusal names.
chi2 is that of the geometric fit under the noise that was drawn, z how far it is off in standard deviations; the tool's
errors are rms over the workspace, after one alignment of the base [mm].
"""

import argparse
import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files
from planner.documents.calibration import Calibration
from planner.fit.noise import Noise
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.model.tool_error import uniform_states
from planner.motion.path.constraints import Constraints
from planner.workflow.identification import identify
from tests.benchmarks.other_arms import CURE, run_command
from tests.benchmarks.true_arms import TrueArm, aligned_distance, readable_urdf, true_flange

GAUGES = ("tracker", "draw-wire", "ball-socket", "edbb")
URDFS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "gen3-lite": ("gen3_lite/6dof/urdf/GEN3-LITE.urdf", "DUMMY"),
    "so101": ("so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
    "iiwa14": ("kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf", "tool0"),
    "panda": ("panda_description/urdf/panda_collision.urdf", "panda_link8"),
    "irb140": ("abb_irb140/urdf/irb140.urdf", "tool0"),
    "z1": ("z1_description/urdf/z1.urdf", "gripperStator"),
    "ur3": ("ur_description/urdf/ur3_robot.urdf", "tool0"),
    "jaco": ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "link_eef"),
}  # file below the packages, and the flange
HEAD = """schema = "edbb-cell/1"
robot = "{robot}"
home_deg = {home}
{tip}
[tool]
map_mm = [{aside:.0f}, 0, {tool:.0f}]
[base]
floor_mm = {floor:.0f}
[motion]
measure = "static"
clearance_mm = 5
[gauge]
kind = "{kind}"
"""
BALLS = "".join(
    f'[[balls]]\nname = "{k}"\nposition_mm = [{{b{x}:.0f}}, {{b{y}:.0f}}, 0]\nradius_mm = {{radius:.0f}}\n'
    for k, (x, y) in enumerate((("0", "0"), ("1", "2"), ("0", "3")), start=1)
)
PLACED = {
    "draw-wire": "length_mm = [{low:.0f}, {high:.0f}]\n[[fixtures]]\nposition_mm = [{x:.0f}, 0, {z:.0f}]\n",
    "edbb": "length_mm = [{low:.0f}, {high:.0f}]\nbody = {{ housing_mm = {tenth:.0f}, trim_mm = 10, radius_mm = 12 }}\n"
    "[[fixtures]]\nposition_mm = [{x:.0f}, 0, {z:.0f}]\n",
    "tracker": "length_mm = [500, {most:.0f}]\ncone_deg = {{ map = 90 }}\n"
    "[tracker]\nposition_mm = [{far:.0f}, 0, 500]\nrpy_deg = [0, 0, 180]\n[plan]\nposes = 60\n",
    "ball-socket": "cone_deg = {{ fixture = 70, map = 70 }}\napproach_mm = {tenth:.0f}\n"
    "[artifact]\nposition_mm = [{x:.0f}, {left:.0f}, {z:.0f}]\n[plan]\nposes = 60\n" + BALLS,
}
TRIED, DRAWN = 2000, 400  # states among which a home is looked for; states that tell the reach
CURED = """schema = "edbb-robot/1"
name = "{name}"
convention = "urdf"
urdf = "{urdf}"
tip = "{tip}"
{cure}
never_meet_reason = "crude bodies of neighbouring links touch"
"""
STATES = 2000  # at which the tool is judged


@dataclass(frozen=True)
class Arm:
    """An arm by shipped name, or by URDF and the link that is its flange."""

    name: str
    urdf: Path | None = None
    tip: str = ""


@dataclass
class Case:
    """What came of an arm with a gauge: seconds, chi2 and its degrees of freedom, errors of the tool [mm]."""

    arm: str
    gauge: str
    words: str = ""
    plan_wall: float = 0.0
    plan_cpu: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    poses: int = 0
    identify_cpu: float = 0.0
    chi2: float = 0.0
    dof: float = 0.0
    findings: list[str] = field(default_factory=list)
    left: str = ""
    nominal: float = 0.0
    stated: float = 0.0
    true: float = 0.0

    @property
    def z(self) -> float:
        """How far chi2 is off what it should be, in standard deviations."""
        return (self.chi2 - self.dof) / np.sqrt(2 * self.dof) if self.dof > 0 else np.nan

    def line(self) -> str:
        """Return its row of the table."""
        found = ", ".join(self.findings) or ("nothing" if self.stated else "")
        return (
            f"{self.arm:<16} {self.gauge:<12} {self.plan_wall:6.1f} {self.plan_cpu:6.1f} {self.identify_cpu:6.1f} "
            f"{self.poses:5d} {self.chi2:7.1f}/{self.dof:<6.1f} {self.z:5.1f}  {self.nominal:7.3f} {self.stated:7.4f} "
            f"{self.true:7.4f}  {self.words}; {found}"
        )


TITLE = (
    f"{'arm':<16} {'gauge':<12} {'wall s':>6} {'cpu s':>6} {'id. s':>6} {'poses':>5} {'chi2/dof':>14} {'z':>5}  "
    f"{'nominal':>7} {'stated':>7} {'true':>7}  end of the plan; found"
)


def write_cell(arm: Arm, kind: str, path: Path) -> Path:
    """Write a cell whose gauge stands in front of the arm, at half its reach, and fits its size."""
    reference = str(arm.urdf or arm.name)
    robot = load_robot(reference, tip=arm.tip or None)
    rng, limit = np.random.default_rng(0), np.deg2rad(179)
    q = rng.uniform(np.maximum(robot.q_lower, -limit), np.minimum(robot.q_upper, limit), (TRIED, robot.n_joints))
    reach = 1e3 * float(np.linalg.norm(robot.chain.carry(robot.theta(q[:DRAWN]), np.zeros(3)), axis=1).max())
    words = {"robot": reference, "tip": f'tip = "{arm.tip}"' if arm.tip else "", "kind": kind}
    share = {"aside": 0.03, "tool": 0.06, "low": 0.2, "high": 0.5, "x": 0.5, "z": 0.1, "floor": -0.3, "tenth": 0.1}
    share |= {"left": -0.1, "radius": 0.01, "b0": 0.0, "b1": 0.1, "b2": 0.1, "b3": 0.2}
    sizes = {k: v * reach for k, v in share.items()} | {"far": 1000 + 2 * reach, "most": 2000 + 4 * reach}
    middle = np.rad2deg(np.clip(0.0, robot.q_lower + 0.1, robot.q_upper - 0.1)).round(1).tolist()
    text = HEAD + PLACED[kind]
    path.write_text(text.format(home=middle, **words, **sizes))
    fit = q[Constraints(load_cell(str(path)), bar=False).valid(q)]
    if len(fit):
        home = np.rad2deg(fit[np.argmin(np.abs(fit).max(axis=1))]).round(1).tolist()
        path.write_text(text.format(home=home, **words, **sizes))
    return path


def time_plan(case: Case, cell: Path, out: Path, limit: float) -> bool:
    """Plan in a process of its own, and note what it cost and how it ended; tell whether there is a plan."""
    words = "plan", cell, "-o", out, "--time-limit-s", limit, "--force"
    case.plan_cpu, case.plan_wall, done = run_command(*words)
    timings = out / "timings.json"
    case.stages = json.loads(timings.read_text()) if timings.is_file() else {}
    ends = {0: "whole", 5: "cut short"}
    case.words = ends.get(done.returncode) or f"exit {done.returncode}: {done.stderr.strip()[-300:]}"
    if done.returncode not in ends:
        return False
    has_path = (out / "trajectory.csv").is_file()  # else the limit left poses alone, which nothing drives to
    case.words += "" if has_path else ", poses alone"
    return has_path


def identify_clean(case: Case, arm: Arm, folder: Path) -> None:
    """Measure an arm whose geometry alone is off by the plan, identify it, and hold it against the truth."""
    cell = load_cell(str(folder / "cell.toml"))
    rng = np.random.default_rng([7, *f"{case.arm} {case.gauge}".encode()])
    q = uniform_states(cell, STATES, 1)
    nominal = TrueArm(cell, true_flange(cell.robot, arm.urdf, arm.tip, rng, errors=False), cell.tool.p_FM, rng)
    assert np.abs(nominal.tool(q[:20]) - cell.map_position(q[:20])).max() < 1e-8, "not the arm that is planned for"
    truth = TrueArm.draw(cell, true_flange(cell.robot, arm.urdf, arm.tip, rng), rng)
    truth.write_run(folder / "plan.json", folder / "run.csv")
    start = time.process_time()
    found = identify(folder / "run.csv", cell=folder / "cell.toml", plan=folder / "plan.json").calibration
    case.identify_cpu = time.process_time() - start
    case.poses, case.findings = found.n_groups, [f"{f.effect}, {f.on}" for c in found.findings for f in c.each]
    case.left = found.diagnosis.sentence if found.diagnosis.structured else ""
    case.chi2, case.dof = compute_chi2(found)
    case.stated = 1e3 * (found.workspace_error or np.nan)
    true = truth.tool(q)
    case.nominal = 1e3 * aligned_distance(nominal.tool(q), true)
    case.true = 1e3 * aligned_distance(released_tool(found, folder, q, cell.tool.p_FM), true)


def compute_chi2(found: Calibration) -> tuple[float, float]:
    """Return chi2 of the fit of geometry under the noise as it was drawn, and its degrees of freedom."""
    fit = found.fit if found.released is None else found.released.geometry
    problem = fit.problem.with_noise(Noise())
    off = fit.model.residual(problem.samples, problem.targets, fit.errors).reshape(len(problem), -1, 1)
    white = problem.whitener.white(off)
    return float((white**2).sum()), white.size - fit.effective


def released_tool(found: Calibration, folder: Path, q: np.ndarray, p_FM: np.ndarray) -> np.ndarray:
    """Return where the tool point is by the robot that is written, (n, 3) [m]."""
    released = folder / "calibrated"
    released.mkdir(exist_ok=True)
    for name, text in calibrated_files(found):
        (released / name).write_text(text)
    p, R = CalibratedRobot(load_robot(released / "robot.toml")).flange(q)
    fit = found.fit if found.released is None else found.released.fit
    fitted = dict(zip(fit.model.names, fit.errors, strict=True))
    return p + R @ (p_FM + [fitted.get(f"map_{x}", 0.0) for x in "xyz"])


def run_case(arm: Arm, gauge: str, folder: Path, limit: float) -> Case:
    """Plan and identify one arm with one gauge; an arm that fails keeps nobody from the next."""
    case = Case(arm.name if arm.urdf is None else f"{arm.name} (URDF)", gauge)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        planned = time_plan(case, write_cell(arm, gauge, folder / "asked.toml"), folder / "plan", limit)
        if arm.urdf and (cure := CURE.search(case.words)):
            cured = (folder / "robot.toml").resolve()
            cured.write_text(CURED.format(name=arm.name, urdf=arm.urdf, tip=arm.tip, cure=cure[0]))
            cell = write_cell(Arm(arm.name, cured), gauge, folder / "asked.toml")
            planned = time_plan(case, cell, folder / "plan", limit)
        if planned:
            identify_clean(case, arm, folder / "plan")
    except Exception as error:
        case.words += f" {type(error).__name__}: {error}"
    return case


def find_arms(packages: list[Path], folder: Path) -> list[Arm]:
    """Return the arms by URDF that are found below the packages, and the shipped ones."""
    folder.mkdir(parents=True, exist_ok=True)
    arms = []
    for name, (tail, tip) in URDFS.items():
        for file in (f for p in packages for f in sorted(p.rglob(Path(tail).name)) if str(f).endswith(tail)):
            arms.append(Arm(name, readable_urdf(file, folder).resolve(), tip))
            break
    return arms + [Arm(name) for name in list_robots()]


def table(cases: list[Case]) -> str:
    """Return the table and what it comes to."""
    lines = [TITLE, *(c.line() for c in cases)]
    planned = [c for c in cases if c.plan_wall]
    judged = [c for c in cases if c.stated]
    if planned:
        wall, cpu = (np.array([getattr(c, k) for c in planned]) for k in ("plan_wall", "plan_cpu"))
        said = (f"{n} s: median {np.median(v):.1f}, worst {v.max():.1f}" for n, v in (("wall", wall), ("cpu", cpu)))
        lines.append(f"{len(planned)} plans, {'; '.join(said)}")
    if judged:
        ratio = np.array([c.true / c.stated for c in judged])
        lines.append(
            f"{len(judged)} runs: chi2/dof {sum(c.chi2 for c in judged) / sum(c.dof for c in judged):.3f}, "
            f"|z| > 3 in {sum(abs(c.z) > 3 for c in judged)}; found in {sum(bool(c.findings) for c in judged)}; "
            f"true error over stated: rms {np.sqrt((ratio**2).mean()):.2f}, largest {ratio.max():.2f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Do all cases that the log lacks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--packages", nargs="*", type=Path, default=[], help="folders with packages of URDFs")
    parser.add_argument("--gauges", nargs="*", default=list(GAUGES))
    parser.add_argument("--only", nargs="*", default=[""], help="words in 'arm/gauge'")
    parser.add_argument("--limit", type=float, default=60.0, help="of each plan [s]")
    parser.add_argument("--table", action="store_true", help="print what the log holds")
    asked = parser.parse_args()
    lines = asked.log.read_text().splitlines() if asked.log.exists() else []
    cases = [Case(**json.loads(line)) for line in lines]
    if not asked.table:
        done = {(c.arm, c.gauge) for c in cases}
        work = asked.log.resolve().with_suffix("")
        arms = find_arms(asked.packages, work / "urdf")
        for arm, gauge in ((a, g) for g in asked.gauges for a in arms):
            name = arm.name if arm.urdf is None else f"{arm.name} (URDF)"
            if (name, gauge) in done or not any(w in f"{name}/{gauge}" for w in asked.only):
                continue
            case = run_case(arm, gauge, work / f"{name}-{gauge}".replace(" ", ""), asked.limit)
            cases.append(case)
            with asked.log.open("a") as log:
                log.write(json.dumps(asdict(case)) + "\n")
            print(case.line(), flush=True)
    print(table(cases))


if __name__ == "__main__":
    main()
