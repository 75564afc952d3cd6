"""The plan's own program drives the robot and calls CENTRE at each ball."""

import pytest

from planner.centring.stop import LinkError, StoppedError
from tests.centring.conftest import settings
from tests.centring.test_session import angles, rows_of


def program(content, poses=None):
    """What a plan's program comes down to: moves, and a call at each ball."""
    ball = {p["id"]: p.get("ball") for p in content["poses"]}
    lines = ["DEF PLANNED ( )", "$RED_VEL=5"]
    for point in content["drives"][0]["waypoints"]:
        axes = ",".join(f"A{j + 1} {a:.6f}" for j, a in enumerate(point["q_deg"]))
        lines.append("PTP {" + axes + "}")
        if ball.get(point["visit"]) and (poses is None or point["visit"] in poses):
            lines.append(f"CENTRE ({ball[point['visit']]},{point['visit']})")
    return "\r\n".join([*lines, "END", ""])


@pytest.fixture
def following(cell):
    def make(poses=None, **how):
        made = cell(**how)
        made.revive(program=program(made.content, poses))
        return made

    return make


def test_every_ball_is_centred(following):
    made = following(tilt=2.0, noise=0.0003)
    made.run(follow=True)
    table = rows_of(made.output)
    assert table["pose"].to_list() == [1, 3, 5]
    assert all(made.world.miss(q) < 0.0055 for q in angles(table))
    left = [made.world.miss(q) for q in made.controller.starts]  # where each of the program's moves began
    assert sum(m < 0.0055 for m in left) >= 2  # on the ball: the routine leaves the arm there, the program logs it
    assert set(made.controller.krl.reduced) == {100}  # centring is as quick as the routine says
    made.controller.threads[1].join(120.0)  # the program goes on to its end by itself
    assert not made.controller.threads[1].is_alive()
    left = {name: made.controller.krl.system[name] for name in ("$ADVANCE", "$RED_VEL", "$VEL.CP", "$ACC.CP")}
    assert left == {"$ADVANCE": 3, "$RED_VEL": 5, "$VEL.CP": 0.25, "$ACC.CP": 2.3}  # as the plan's program had them


def test_what_is_measured_is_left_at_once(following):
    made = following()
    made.said = []
    append = made.said.append
    made.said = type("Said", (list,), {"append": lambda self, line: (append(line), made.stop.ask("Ctrl-C"))})()
    with pytest.raises(StoppedError, match="1 of 3 poses are kept"):
        made.run(follow=True)
    made.said = []
    made.revive(program=program(made.content))
    made.run(follow=True)
    assert rows_of(made.output)["pose"].to_list() == [1, 3, 5]
    assert len(made.said) == 2


def test_another_plans_program(following):
    made = following()
    made.controller.krl.values["EDBB_POSE"] = 99
    made.revive(program=program(made.content).replace(",3)", ",77)"))
    with pytest.raises(LinkError, match="is at pose 77, which this plan has not"):
        made.run(follow=True)


def test_a_program_that_stands_elsewhere(following):
    made = following()
    made.revive(program=program(made.content).replace("(1,1)", "(2,3)"))
    with pytest.raises(LinkError, match=r"deg away from pose 3 of this plan"):
        made.run(follow=True)


def test_a_program_that_never_comes(following):
    made = following(poses=[1])
    with pytest.raises(LinkError, match=r"came to no ball within 0\.3 s"):
        made.run(settings(robot={"arrive_s": 0.3}), follow=True)
    assert rows_of(made.output)["pose"].to_list() == [1]


def test_a_ball_that_is_passed_by_is_left_at_once(following):
    made = following()
    made.adviser = Passing({3})
    made.run(follow=True)
    assert rows_of(made.output)["pose"].to_list() == [1, 5]
    assert made.said[1] == "pose 3 on ball 2: passed by, the goal is reached"
    assert made.said[2].endswith("; 2 read")


class Passing:
    """Passes some poses, and counts the others."""

    def __init__(self, poses):
        self.poses, self.count = poses, 0

    def passes(self, pose):
        return "the goal is reached" if pose in self.poses else ""

    def advise(self, row):
        self.count += 1
        return f"{self.count} read"
