"""URScript and FANUC TP, whose joints are not plain degrees or stand behind the moves, are corrected in place."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.compensation.compensated_file import compensate_file
from tests.compensation.robots import bent, exact, flange_pose

SCRIPT = """def part():
  movej([0.1, -1.2, 1.3, -0.4, -1.5, 0.6], a=1.4, v=1.05)
  movej([d2r(10), d2r(-70.0), d2r(80.0), d2r(-20.0), d2r(-80.0), d2r(5)], v=d2r(20), r=0.01)
  movel(p[0.4, 0.2, 0.3, 0, 3.14, 0], v=0.1)
end
"""
TP = """/PROG PART
/MN
   1:J P[1] 20% FINE    ;
   2:L P[2] 100mm/sec FINE    ;
/POS
P[1]{
   GP1:
  UF : 0, UT : 1,
  J1=    10.000 deg,  J2=   -70.000 deg,  J3=    80.000 deg,
  J4=   -20.000 deg,  J5=   -80.000 deg,  J6=     5.000 deg
};
P[2]{
   GP1:
  UF : 0, UT : 1,  CONFIG : 'N U T, 0, 0, 0',
  X =   400.000  mm,  Y =   200.000  mm,  Z =   300.000  mm,
  W =     0.000 deg,  P =     0.000 deg,  R =     0.000 deg
};
/END
"""
TAUGHT = np.deg2rad([10.0, -70.0, 80.0, -20.0, -80.0, 5.0])


def _angles(name: str, text: str) -> np.ndarray:
    """The taught angles of the last joint target [rad]."""
    if name.endswith(".script"):
        (line,) = re.findall(r"movej\(\[(d2r.*?)\]", text)
        return np.deg2rad([float(n) for n in re.findall(r"d2r\((.*?)\)", line)])
    return np.deg2rad([float(n) for n in re.findall(r"J\d=\s*(\S+) deg", text)])


@pytest.mark.parametrize(("name", "text"), [("part.script", SCRIPT), ("part.ls", TP)])
def test_the_real_robot_reaches_where_the_nominal_one_was_sent(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    nominal, real = bent("ur10", seed=3)
    done = compensate_file(tmp_path / name, nominal, real)
    q = _angles(name, done.text)
    wanted, reached, before = flange_pose(exact(nominal), TAUGHT), flange_pose(real, q), flange_pose(real, TAUGHT)
    assert np.linalg.norm((before - wanted)[:3, 3]) > 5e-4
    assert np.linalg.norm((reached - wanted)[:3, 3]) < 2e-5
    assert done.report.kept  # the straight line to a Cartesian pose is told and left
    assert "Compensated in part" in done.text


def test_radians_stay_radians(tmp_path: Path) -> None:
    (tmp_path / "part.script").write_text(SCRIPT)
    nominal, real = bent("ur10", seed=3)
    text = compensate_file(tmp_path / "part.script", nominal, real).text
    q = np.array([float(n) for n in re.findall(r"movej\(\[([-\d][^\]]*)\]", text)[0].split(",")])
    taught = np.array([0.1, -1.2, 1.3, -0.4, -1.5, 0.6])
    assert 0.0 < np.abs(q - taught).max() < 0.01
    assert np.linalg.norm((flange_pose(real, q) - flange_pose(exact(nominal), taught))[:3, 3]) < 1e-6
