"""Plan a session for an arm of your own: a URDF, and a cell file that names it."""

import sys
from pathlib import Path

from planner import load_robot, plan

HERE = Path(__file__).parent


def main(folder: str = "urdf_session", poses: int = 40) -> None:
    robot = load_robot(HERE / "arm.urdf", tip="flange")
    print(f"{robot.name}: {robot.n_joints} joints")
    session = plan(HERE / "own_urdf.toml", poses=poses, dialect=["rapid"])
    print(session.summary())
    session.write(folder)


if __name__ == "__main__":
    main(*sys.argv[1:2])
