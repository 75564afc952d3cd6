"""Plan the shipped cell, simulate the run, identify the robot and correct its own program."""

import sys
from pathlib import Path

from planner import compensate, identify, plan, simulate


def main(folder: str = "seed_cell", cell: str = "kuka-kr6-r700/edbb", poses: int = 40) -> None:
    out = Path(folder)
    session = plan(cell, poses=int(poses), dialect=["krl"], progress=lambda stage, done, of: None)
    print(session.summary())
    session.write(out / "session")
    session.plot_index().save(out / "index.png")

    run = simulate(session, seed=1)  # a robot with drawn errors; a measured run is read with load_run
    found = identify(run.run, cell=session.plan.cell, plan=session, no_trace=True)
    print(found.summary())
    found.write(out / "calibrated")

    program = next(path for path in (out / "session").iterdir() if path.suffix == ".src")
    corrected = compensate(program, model=found)  # singular targets stay and are listed
    print(corrected.summary())
    corrected.write(out / program.name)


if __name__ == "__main__":
    main(*sys.argv[1:])
