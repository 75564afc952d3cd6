"""Where what no cause explains moves the tool most: found where it was put, and said in words."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.common.units import DEG
from planner.inference.misfit import Misfit
from planner.model.identification_document import ErrorParts
from planner.model.misfit_place import MisfitPlace
from planner.release.error_parts import acts_like, largest_misfit, open_misfit
from planner.release.tool_map import ToolMap
from planner.workflow.fit_overview import _misfit_facts, _part_facts

Q = np.random.default_rng(0).uniform(-2.0, 2.0, (2000, 6))
LOW = 1e-8  # [m²]


def squares(*inside):
    """A hundred times the square where all of the joints (number, lower end, upper end) are inside."""
    out = np.full(len(Q), LOW)
    if inside:
        out[np.all([(Q[:, j - 1] > a) & (Q[:, j - 1] < b) for j, a, b in inside], axis=0)] *= 100
    return out


def test_misfit_in_a_corner_is_found_by_both_of_its_joints():
    place = largest_misfit(squares((2, 1.0, 2.0), (4, -2.0, -1.0)), Q)
    ends = {r.joint: r.range for r in place.ranges}
    assert ends[2] == pytest.approx((1.0, 2.0), abs=0.1)
    assert ends[4] == pytest.approx((-2.0, -1.0), abs=0.1)
    assert place.anywhere < place.there < place.within.there == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize(("inside", "named"), [([(3, -1.0, 0.0)], 1), ([], 0)])
def test_no_joint_is_named_that_makes_no_difference(inside, named):
    place = largest_misfit(squares(*inside), Q)
    assert [r.joint for r in place.ranges] == [3][:named]
    assert place.within is None


def test_the_document_keeps_both_ranges_and_the_screen_says_them():
    place = largest_misfit(squares((2, 1.0, 2.0), (4, -2.0, -1.0)), Q)
    written = place.model_dump(mode="json", by_alias=True)
    assert written["within"]["range_deg"] == pytest.approx([v / DEG for v in place.within.range])
    assert MisfitPlace.model_validate(written).within.joint == place.within.joint
    where = place.text()
    assert all(r.text in where for r in place.ranges)
    inside = np.all(
        [(Q[:, r.joint - 1] >= r.range[0]) & (Q[:, r.joint - 1] <= r.range[1]) for r in place.ranges], axis=0
    )
    there, elsewhere = (1e3 * np.sqrt(squares((2, 1.0, 2.0), (4, -2.0, -1.0))[k].mean()) for k in (inside, ~inside))
    assert where.endswith(f"({there:.3f}, else {elsewhere:.3f})")
    assert place.text(unit=" mm") == f"{where[:-1]} mm)"


def test_misfit_that_no_joint_tells_of_is_said_with_its_least_and_most():
    """Twice as much in a quarter of one joint's range, where 1.2 times the whole's would be worth naming, but mixed."""
    square = LOW * (1 + 0.2 * np.sin(3 * Q[:, 0]))
    place = largest_misfit(square, Q)
    assert not place.ranges
    order = np.argsort(Q[:, 0])
    means = [square[k].mean() for k in np.array_split(order, 4)]
    assert place.least <= 1.0001 * np.sqrt(min(means))
    assert place.most >= 0.9999 * np.sqrt(max(means))
    assert place.text() == f"nearly even ({1e3 * place.least:.3f} to {1e3 * place.most:.3f} mm)"


@pytest.mark.parametrize(("unseen", "drift", "said"), [(3e-4, 0.0, "unseen"), (1e-4, 0.0, None), (3e-4, 2e-4, "drift")])
def test_the_screen_says_what_most_of_the_error_is(unseen, drift, said):
    parts = ErrorParts(seen=2e-4, unseen=unseen, misfit=0.0, drift=drift)
    facts = list(_part_facts(parts, said=False))
    assert "unseen" not in dict(_part_facts(parts, said=True))  # a line of its own says what they hide
    assert [name for name, _ in facts] == [said] * (said is not None)
    size = {"unseen": unseen, "drift": drift}.get(said, 0.0)
    assert all(text.startswith(f"{1e3 * size:.3f} mm of it") for _, text in facts)


def overview_of(floor=None, more=None):
    return SimpleNamespace(noise_floor=floor, more=more)


@pytest.mark.parametrize(("misfit", "told"), [(3e-4, True), (1e-4, True), (4e-5, False)])
@pytest.mark.parametrize(("more", "how"), [("20 more poses", " by edbb plan --after"), (None, "")])
def test_misfit_that_counts_is_one_line_how_much_where_like_what_and_what_to_measure(misfit, told, more, how):
    """Without a tenth of the square 5 % less would be stated: less nobody notices."""
    parts = ErrorParts(seen=1e-4, unseen=2e-4, misfit=misfit, drift=0.0)
    place = largest_misfit(squares((2, 1.0, 2.0), (4, -2.0, -1.0)), Q).model_copy(update={"like": "a turn of it"})
    lines = list(_misfit_facts(overview_of(more=more), SimpleNamespace(parts=parts, misfit_place=place)))
    line = f"{1e3 * misfit:.3f} mm by unnamed causes, {place.text(1)}, like a turn of it: measure there{how}"
    assert lines == [("misfit", line)] * told
    assert not list(_misfit_facts(overview_of(), SimpleNamespace(parts=parts, misfit_place=None)))


@pytest.mark.parametrize(
    ("floor", "more", "cure"),
    [
        (None, None, "20 poses twice ([plan] repeat) tell it from noise"),
        (1e-5, None, "measure more all over the workspace"),
        (1e-5, "20 more poses", "measure more by edbb plan --after"),
    ],
)
def test_misfit_that_is_even_may_be_noise_unless_poses_were_repeated(floor, more, cure):
    parts = ErrorParts(seen=1e-4, unseen=1e-4, misfit=3e-4, drift=0.0)
    place = largest_misfit(squares(), Q)
    ((_, line),) = _misfit_facts(overview_of(floor, more), SimpleNamespace(parts=parts, misfit_place=place))
    assert line.endswith(f"nearly even (0.100 to 0.100 mm): {cure}")
    assert len(line) + len(", like a turn behind joint 3 by gravity") + 14 <= 165  # of a screen


def drawn_robot(rest, sizes, named=1e-4, count=400):
    """A robot of two families without a name and a named error, drawn with these sizes; stretch of 1."""
    rng = np.random.default_rng(3)
    names = ("a2", "misfit3_x_gravity1_0", "misfit_base_rx_cos0", "tool")
    q = Q[:500]
    rows = np.zeros((len(q), 3, 3))
    rows[:, 0, 0], rows[:, 1, 1], rows[:, 2, 2] = 1.0, np.where(q[:, 2] > 1.0, 3.0, 1.0), 1.0  # a part: by joint 3
    tool = ToolMap(q, np.zeros(3), np.zeros((len(q), 3)), names[:3], rows)
    drawn = np.concatenate([rng.normal(size=(3, count)) * np.array([named, *sizes])[:, None], np.zeros((1, count))])
    model = SimpleNamespace(names=names)
    record = SimpleNamespace(
        model=model,
        names=("lengths", "misfit, part 3 by gravity (background)", "misfit, base by its load (background)"),
        effects=SimpleNamespace(family=np.array([0, 1, 2, -1])),
    )
    fit = SimpleNamespace(model=model, errors=np.zeros(4))
    posterior = SimpleNamespace(fit=fit, drawn=drawn, of_noise=drawn, record=record)
    return SimpleNamespace(posterior=posterior, tool=tool, misfit=Misfit(np.ones(count), np.full(count, rest)))


@pytest.mark.parametrize(
    ("rest", "sizes", "like"),
    [
        (1e-6, (3e-4, 1e-4), "a turn behind joint 3 by gravity"),
        (1e-6, (1e-5, 3e-4), "a turn of the base by its load"),
        (1e-3, (1e-4, 1e-4), "scatter from pose to pose"),
        (1e-4, (1e-4, 2e-4), None),
    ],
)
def test_misfit_acts_like_the_law_that_makes_up_most_of_it(rest, sizes, like):
    assert acts_like(drawn_robot(rest, sizes)) == like


def test_what_misfit_leaves_open_is_largest_where_it_was_put_and_makes_up_its_part():
    robot = drawn_robot(1e-6, (3e-4, 1e-6))
    parts = ErrorParts(seen=1e-4, unseen=1e-4, misfit=2e-4)
    square = open_misfit(robot, parts)
    assert np.sqrt(square.mean()) == pytest.approx(2e-4)
    place = largest_misfit(square, robot.tool.q)
    assert [r.joint for r in place.ranges] == [3]
    assert place.range[0] == pytest.approx(1.0, abs=0.1)
    inside = robot.tool.q[:, 2] > 1.0  # three times as far there, the square nine times as large
    assert np.sqrt(square[inside].mean() / square[~inside].mean()) == pytest.approx(3.0, rel=0.05)
