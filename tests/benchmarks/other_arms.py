"""Twenty arms of other makers, whole: ``python -m tests.benchmarks.other_arms LOG.jsonl --packages DIR …``.

Each is planned by the command, measured with a draw wire on an arm with drawn geometric errors (pinocchio, nothing of
the planner), identified, and a table of targets is corrected. The driven path is held against all links of the URDF by
pinocchio and coal at every 0.1° (and 0.1 mm). One line of LOG an arm; what stands there is not done again; ``--only
WORD …`` takes those whose name holds a word, ``--table`` only prints.

The packages: ``pip download --no-deps example-robot-data rtb-data==1.0.1 pybullet hello-robot-stretch-urdf
dexmate-urdf synriard orca-arm airo-models armar fourier-robot-descriptions jvrc-description``, unpacked below DIR.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.motion.path.constraints import Constraints
from tests.benchmarks.true_arms import aligned_distance
from tests.benchmarks.urdf_arms import UrdfArm, count_meetings, driven_states

ERD, RTB = "example-robot-data/robots", "rtbdata/xacro"
DRAKE = '<drake:proximity_properties><drake:mesh_resolution_hint value="1.5"/></drake:proximity_properties></collision>'


@dataclass(frozen=True)
class OtherArm:
    """An arm of another maker.

    Attributes:
        file, tip: its description below a package, and the link that carries the tool; ``base`` its first link.
        lines: of ``robot.toml`` that the description needs: what is parked, what it leaves out.
        change: text of the description that is put in, as another program writes it: old and new.
        tool_mm: where the wire is held, beyond a gripper that the description has; else a share of the reach.
        cell: lines of the cell that the arm needs: where the floor is beneath one that hangs at a trunk.
        gauge: lines of its ``[gauge]``; ``clearance_mm``: how near bodies may come.
    """

    name: str
    file: str
    tip: str
    base: str = ""
    lines: str = ""
    change: tuple[str, str] = ("", "")
    tool_mm: tuple[float, float, float] | None = None
    cell: str = ""
    gauge: str = ""
    clearance_mm: float = 5.0


ARMS = (
    OtherArm("TIAGo, lift and arm", f"{ERD}/tiago_description/robots/tiago_no_hand.urdf", "arm_tool_link", "base_link"),
    OtherArm("dual Panda, right arm", f"{RTB}/franka_description/robots/dual_panda_example.urdf.xacro", "panda_1_hand",
        tool_mm=(0, 0, 200),
        lines='[packages]\nfranka_description = "{folder}/.."\n'),
    OtherArm(
        "Baxter, left arm", f"{ERD}/baxter_description/urdf/baxter.urdf", "left_gripper_base_link", "torso",
        'srdf = "{folder}/../srdf/baxter_manipulation.srdf"\n',
    ),
    OtherArm("SO-101", f"{ERD}/so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
    OtherArm("UR3, Drake's tags", f"{ERD}/ur_description/urdf/ur3_robot.urdf", "tool0",
        lines='[packages]\nexample-robot-data = "{folder}/../../.."\n', change=("</collision>", DRAKE)),
    OtherArm("UR5", f"{ERD}/ur_description/urdf/ur5_robot.urdf", "tool0"),
    OtherArm("UR10", f"{ERD}/ur_description/urdf/ur10_robot.urdf", "tool0"),
    OtherArm("Panda", f"{ERD}/panda_description/urdf/panda_collision.urdf", "panda_hand_tcp", tool_mm=(0, 0, 40),
             cell="[base]\nfloor_mm = -100\n"),
    OtherArm("Unitree Z1", f"{ERD}/z1_description/urdf/z1.urdf", "gripperStator", tool_mm=(200, 0, 0)),
    OtherArm("Kinova Jaco 6", f"{ERD}/kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    OtherArm("xArm7", f"{ERD}/xarm_description/urdf/xarm7.urdf", "link_eef"),
    OtherArm("TALOS, left arm", f"{ERD}/talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link",
             tool_mm=(0, 0, -240), cell="[base]\nfloor_mm = -1100\n"),
    OtherArm("PR2, lift and left arm", f"{ERD}/pr2_description/urdf/pr2.urdf", "l_gripper_tool_frame", "base_link",
             tool_mm=(40, 0, 0)),
    OtherArm("Fetch, lift and arm", f"{RTB}/fetch_description/robots/fetch.urdf", "gripper_link", "base_link",
             tool_mm=(80, 0, 0)),
    OtherArm("Gen3", f"{RTB}/kortex_description/robots/gen3.xacro", "end_effector_link",
             lines='[packages]\nkortex_description = "{folder}/.."\n'),
    OtherArm("IRB 140", f"{RTB}/abb_irb140/urdf/irb140.urdf", "tool0"),
    OtherArm("KR 210 L150", f"{RTB}/kuka_description/kuka_kr210/urdf/kr210l150.urdf", "tool0"),
    OtherArm("WidowX 250s", f"{RTB}/interbotix_descriptions/urdf/wx250s.urdf.xacro", "/ee_gripper_link",
             tool_mm=(60, 0, 0)),
    OtherArm("iiwa 7", "pybullet_data/kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    OtherArm("xArm6", "pybullet_data/xarm/xarm6_robot.urdf", "link6"),
    OtherArm("Stretch 3, lift, telescope and wrist", "SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf",
             "link_grasp_center", "base_link", gauge="cone_deg = { fixture = 150, map = 150 }\n",
             lines="[parked]\njoint_arm_l1_mm = 60\njoint_arm_l2_mm = 60\njoint_arm_l3_mm = 60\n"),
    OtherArm("Vega 1, torso and right arm", "vega_1/vega_1_gripper.urdf", "R_ee", "base",
             'srdf = "{folder}/vega_1_gripper.srdf"\n'),
    OtherArm("Alicia M", "Alicia_M_v1_2/Alicia_M_v1_2_follower.urdf", "tool0", clearance_mm=3,
             gauge="cone_deg = { fixture = 150, map = 150 }\n"),
    OtherArm("OpenArm with ORCA hand, right", "orca_arm/orcabot.urdf", "orcahand_right_R-Carpals_8d1f1041",
             "openarm_right_link0"),
    OtherArm("UR5e of airo", "arms/ur5e/ur5e.urdf", "tool0"),
    OtherArm("ARMAR-6, lift and right arm", "description/urdf/armar6.urdf", "arm_t8_r0", "platform",
             lines='[packages]\narmar = "{folder}/../.."\n',
             change=("1.5707963, 1.3089969", "1.5707963 1.3089969")),  # a comma that pinocchio takes for the end
    OtherArm("GR-3, left arm", "assets/urdf/gr3.urdf", "left_hand_roll_link", "torso_link",
             cell="[base]\nfloor_mm = -1200\n"),
    OtherArm("JVRC-1, right arm", "jvrc_description/urdf/jvrc1.urdf", "R_WRIST_Y_S", "WAIST_R_S",
             cell="[base]\nfloor_mm = -1000\n"),
)  # fmt: skip
ROBOT = """schema = "edbb-robot/1"
name = "{name}"
convention = "urdf"
urdf = "{urdf}"
tip = "{tip}"
{base}{lines}"""
CELL = """schema = "edbb-cell/1"
robot = "robot.toml"
home_deg = {home}
{slides}
[tool]
map_mm = {tool}
[motion]
measure = "static"
clearance_mm = {clearance:g}
[gauge]
kind = "draw-wire"
length_mm = [{low:.0f}, {high:.0f}]
{gauge}[[fixtures]]
position_mm = {at}
[plan]
candidates = {candidates}
{more}"""
CANDIDATES = 20_000  # poses that compete: a fifth of what a plan has unless it is said
PLANNED = (0, 5)  # ends of a plan: whole, or with searches cut short by the limit
CURE = re.compile(r"never_meet = \[\[.*\]\]")  # of links whose crude bodies touch, as a refused cell is told
REASON = 'never_meet_reason = "crude bodies of neighbouring links touch"\n'
TRIED, PLACES, TARGETS = 3000, 200, 40  # states that tell the reach, places of the fixture, targets to be corrected


@dataclass
class Outcome:
    """What came of an arm: how it ended, processor seconds, poses, states that were checked, errors [mm]."""

    arm: str
    words: str = ""
    joints: str = ""
    plan_cpu: float = 0.0
    plan_wall: float = 0.0
    poses: int = 0
    states: int = 0
    meetings: dict[str, int] = field(default_factory=dict)
    identify_cpu: float = 0.0
    nominal: float = 0.0
    stated: float = 0.0
    true: float = 0.0
    corrected_cpu: float = 0.0
    targets_before: float = 0.0
    targets_after: float = 0.0

    @property
    def whole(self) -> bool:
        """Whether it went to its end: planned without a collision, identified, and targets corrected."""
        return self.words == "whole" and not self.meetings and 0 < self.targets_after < self.targets_before

    def line(self) -> str:
        """Return its row of the table in Markdown."""
        hits = sum(self.meetings.values())
        return (
            f"| {self.arm} | {self.joints} | {self.poses} | {self.plan_cpu:.0f} | {self.identify_cpu:.0f} | "
            f"{hits} of {self.states} | {self.nominal:.2f} | {self.stated:.3f} | {self.true:.3f} | "
            f"{self.targets_before:.2f} → {self.targets_after:.3f} | {'whole' if self.whole else self.words} |"
        )


HEAD = (
    "| arm | joints | poses | plan [s] | identify [s] | states in collision | error before [mm] | stated after [mm] | "
    "true after [mm] | targets [mm] | |\n|---|---|---|---|---|---|---|---|---|---|---|"
)


def run_command(*words: object) -> tuple[float, float, subprocess.CompletedProcess[str]]:
    """Run ``edbb`` in a process of its own; processor and wall seconds, and how it ended."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "planner.cli", *map(str, words)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=os.environ)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.perf_counter() - start, done


def write_description(arm: OtherArm, urdf: Path, folder: Path, more: str = "") -> Robot:
    """Write ``robot.toml``, and the description with its change where it has one; return the robot."""
    folder.mkdir(parents=True, exist_ok=True)
    lines, file = more + arm.lines.format(folder=urdf.parent), urdf
    if arm.change[0]:
        file = folder / urdf.name
        file.write_text(urdf.read_text().replace(*arm.change))
    base = f'base = "{arm.base}"\n' if arm.base else ""
    name = re.sub(r"[^a-z0-9]+", "-", arm.name.lower())
    text = ROBOT.format(name=name, urdf=file, tip=arm.tip, base=base, lines=lines)
    (folder / "robot.toml").write_text(text)
    return load_robot(folder / "robot.toml")


def write_cell(robot: Robot, folder: Path, arm: OtherArm) -> Path:
    """Write a cell whose wire is fixed where the tool comes near from most sides; home is the least bent free state."""
    rng, (low, high) = np.random.default_rng(0), robot.one_turn
    q = rng.uniform(low, high, (TRIED, robot.n_joints))
    x = robot.chain.carry(robot.theta(q), np.zeros(3))
    centre = np.median(x, axis=0)
    reach = 1e3 * float(np.quantile(np.linalg.norm(x - centre, axis=1), 0.95))
    tool = [round(0.03 * reach), 0, round(0.06 * reach)] if arm.tool_mm is None else list(arm.tool_mm)
    words = {"low": 0.3 * reach, "high": 0.9 * reach}

    def write(home: np.ndarray, at: np.ndarray) -> Path:
        shown = np.rad2deg(home).round(1)
        slides = f"home_mm = {shown[robot.slides].tolist()}" if robot.slides.any() else ""
        text = CELL.format(
            home=shown[~robot.slides].tolist(),
            slides=slides,
            at=(1e3 * at).round(0).tolist(),
            tool=tool,
            candidates=CANDIDATES,
            more=arm.cell,
            gauge=arm.gauge,
            clearance=arm.clearance_mm,
            **words,
        )
        (folder / "cell.toml").write_text(text)
        return folder / "cell.toml"

    middle = np.clip(np.where(robot.slides, (low + high) / 2, 0.0), low + 0.02, high - 0.02)
    path = write(middle, centre + np.array([0.0, 0.0, 3e-4 * reach]))
    free = q[Constraints(load_cell(str(path)), bar=False).valid(q)]
    if not len(free):
        return path
    x = robot.chain.carry(robot.theta(free), np.zeros(3))
    home = free[np.argmin((np.abs(free - middle) / (high - low)).max(axis=1))]
    places = x[:PLACES]
    away = np.linalg.norm(x[None] - places[:, None], axis=2) * 1e3
    count = ((away > words["low"]) & (away < words["high"])).sum(axis=1)
    return write(home, places[np.argmax(count)])


def plan_arm(found: Outcome, arm: OtherArm, urdf: Path, folder: Path, options: list[object]) -> Robot | None:
    """Plan; crude bodies that touch at home are left out as the refusal says, up to three times."""
    more = ""
    for _ in range(4):
        robot = write_description(arm, urdf, folder, more)
        cell = write_cell(robot, folder, arm)
        words = "plan", cell, "-o", folder / "plan", "--force", "--dialect", "poses-csv", *options
        cpu, wall, done = run_command(*words)
        found.plan_cpu, found.plan_wall = found.plan_cpu + cpu, found.plan_wall + wall
        cure = CURE.search(done.stderr)
        if done.returncode in PLANNED or cure is None or cure[0] in more:
            break
        pairs = [*re.findall(r"\[\"[^\]]*\]", more), *re.findall(r"\[\"[^\]]*\]", cure[0])]
        more = f"never_meet = [{', '.join(dict.fromkeys(pairs))}]\n{REASON}"
    found.joints = f"{(~robot.slides).sum()}" + (f" + {robot.slides.sum()} sliding" if robot.slides.any() else "")
    if done.returncode not in PLANNED or not (folder / "plan" / "trajectory.csv").is_file():
        found.words = (
            f"exit {done.returncode}: {done.stderr.strip()[-600:]}" if done.returncode not in PLANNED else "poses alone"
        )
        return None
    return robot


def run_arm(arm: OtherArm, urdf: Path, folder: Path, options: list[object]) -> Outcome:
    """Plan, check, measure, identify and correct one arm; one that fails keeps nobody from the next."""
    found = Outcome(arm.name)
    try:
        robot = plan_arm(found, arm, urdf, folder, options)
        if robot is not None:
            judge(found, robot, folder)
    except Exception as error:
        found.words += f" {type(error).__name__}: {error}"
    return found


def judge(found: Outcome, robot: Robot, folder: Path) -> None:
    """Check the driven path, and follow the arm to its corrected targets."""
    plan = folder / "plan"
    states = driven_states(plan / "trajectory.csv", robot)
    found.states, found.meetings = len(states), count_meetings(robot, states)
    cell = load_cell(str(plan / "cell.toml"))
    rng = np.random.default_rng([7, *found.arm.encode()])
    nominal = UrdfArm.read(robot, cell.tool.p_FM, rng, errors=False)
    true = UrdfArm.read(robot, cell.tool.p_FM, rng)
    q = rng.uniform(*robot.one_turn, (400, robot.n_joints))
    assert np.abs(nominal.tool(q) - cell.map_position(q)).max() < 1e-8, "not the arm that is planned for"
    found.poses = true.write_run(cell, plan / "plan.json", plan / "run.csv")
    words = "identify", plan / "run.csv", "--cell", plan / "cell.toml", "--plan", plan / "plan.json"
    found.identify_cpu, _, done = run_command(*words, "-o", plan / "calibrated", "--force")
    if done.returncode:
        found.words = f"identify, exit {done.returncode}: {done.stderr.strip()[-300:]}"
        return
    document = json.loads((plan / "calibrated" / "identification.json").read_text())
    found.stated = float(document["known_anywhere_mm"])
    released = load_robot(plan / "calibrated" / "robot.toml")
    states = rng.uniform(*cell.joint_range, (2000, robot.n_joints))
    there = true.tool(states)
    found.nominal = 1e3 * aligned_distance(nominal.tool(states), there)
    found.true = 1e3 * aligned_distance(released_tool(released, states), there)
    correct_targets(found, released, true, nominal, plan, states[:TARGETS])


def released_tool(released: Robot, q: np.ndarray) -> np.ndarray:
    """Return where the measured tool point is by the robot that is written, (n, 3) [m]."""
    motion = released.chain.forward(released.theta(q))
    return (motion.x + np.einsum("ijn,j->in", motion.R, released.tool_points[0].p_FM)).T


def correct_targets(
    found: Outcome, released: Robot, true: UrdfArm, nominal: UrdfArm, plan: Path, q: np.ndarray
) -> None:
    """Correct a table of joint targets, and drive the true arm to both."""
    head = ",".join(released.joint_columns("q"))
    q = np.clip(q, *(end + s * 0.02 for end, s in zip(released.one_turn, (1, -1), strict=True)))
    rows = "\n".join(",".join(f"{v:.6f}" for v in row) for row in np.rad2deg(q))
    (plan / "targets.csv").write_text(f"{head}\n{rows}\n")
    words = "compensate", plan / "targets.csv", "--model", plan / "calibrated" / "robot.toml"
    found.corrected_cpu, _, done = run_command(*words, "-o", plan / "corrected.csv", "--force")
    if done.returncode not in PLANNED:  # 5: some targets were left as they were
        found.words = f"compensate, exit {done.returncode}: {done.stderr.strip()[-300:]}"
        return
    lines = [x for x in (plan / "corrected.csv").read_text().splitlines() if x and not x.startswith("#")]
    corrected = np.deg2rad([[float(v) for v in x.split(",")] for x in lines[1:]])
    wanted = replace(nominal, p_FM=released.tool_points[0].p_FM).tool(q)  # the tool stays what it is
    found.targets_before = 1e3 * aligned_distance(true.tool(q), wanted)
    found.targets_after = 1e3 * aligned_distance(true.tool(corrected), wanted)
    found.words = "whole"


def find_file(packages: list[Path], tail: str) -> Path | None:
    """Return the file below the packages whose path ends so."""
    files = (f for p in packages for f in sorted(p.rglob(Path(tail).name)) if str(f).endswith(tail))
    return next(files, None)


def main() -> None:
    """Do all arms that the log lacks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--packages", nargs="*", type=Path, default=[], help="folders with packages of URDFs")
    parser.add_argument("--only", nargs="*", default=[""], help="words in the arm's name")
    parser.add_argument("--limit", type=float, default=600.0, help="of each plan [s]")
    parser.add_argument("--poses", type=int, help="of each plan, chosen by its error; as many as pay without it")
    parser.add_argument("--table", action="store_true", help="print what the log holds")
    asked = parser.parse_args()
    options: list[object] = [
        "--time-limit-s",
        asked.limit,
        *(["--aim", "tracing", "--poses", asked.poses] if asked.poses else []),
    ]
    lines = asked.log.read_text().splitlines() if asked.log.exists() else []
    outcomes = [Outcome(**json.loads(line)) for line in lines]
    if not asked.table:
        done, work = {o.arm for o in outcomes}, asked.log.resolve().with_suffix("")
        for arm in ARMS:
            urdf = find_file(asked.packages, arm.file)
            if arm.name in done or urdf is None or not any(w in arm.name for w in asked.only):
                continue
            folder = work / re.sub(r"\W+", "-", arm.name)
            outcomes.append(run_arm(arm, urdf.resolve(), folder, options))
            with asked.log.open("a") as log:
                log.write(json.dumps(asdict(outcomes[-1])) + "\n")
            print(outcomes[-1].line(), flush=True)
    print("\n".join([HEAD, *(o.line() for o in outcomes)]))
    print(f"{sum(o.whole for o in outcomes)} of {len(outcomes)} whole")


if __name__ == "__main__":
    main()
