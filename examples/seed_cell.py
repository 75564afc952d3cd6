"""Plan the shipped cell, simulate the run, identify the robot and correct targets of its work."""

import sys
from pathlib import Path

from planner import compensate, identify, plan, simulate

TARGETS = """q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg
10,-80,95,5,40,0
-20,-95,100,20,50,30
"""


def main(folder: str = "seed_cell", cell: str = "kuka-kr6-r700/edbb", poses: int = 40) -> None:
    out = Path(folder)
    session = plan(cell, poses=int(poses), dialect=["krl"], progress=lambda stage, done, of: None)
    print(session.summary())
    session.write(out / "session")
    session.plot("index_curve").save(out / "index.png")

    run = simulate(session, seed=1)  # a robot with drawn errors; a measured run is read with load_run
    found = identify(run.run, cell=session.plan.cell, plan=session, no_trace=True)
    print(found.summary())
    found.write(out / "calibrated")

    targets = out / "targets.csv"  # or a robot program; measuring programs stay as they are
    targets.write_text(TARGETS)
    corrected = compensate(targets, model=found)  # singular targets stay and are listed
    print(corrected.summary())
    corrected.write(out / "corrected.csv")


if __name__ == "__main__":
    main(*sys.argv[1:])
