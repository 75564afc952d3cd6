"""Where what no cause explains moves the tool most: found where it was put, and said in words."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.common.units import DEG
from planner.identification.error_parts import largest_misfit
from planner.model.identification_document import ErrorParts
from planner.model.misfit_place import MisfitPlace
from planner.workflow.fit_overview import _misfit_facts, _motion_place, _part_facts

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
    where = _motion_place(place)
    assert all(r.text in where for r in place.ranges)
    assert f"({1e3 * place.within.there:.3f} mm)" in where


@pytest.mark.parametrize(("unseen", "drift", "said"), [(3e-4, 0.0, "unseen"), (1e-4, 0.0, None), (3e-4, 2e-4, "drift")])
def test_the_screen_says_what_most_of_the_error_is(unseen, drift, said):
    facts = list(_part_facts(ErrorParts(seen=2e-4, unseen=unseen, misfit=0.0, drift=drift)))
    assert [name for name, _ in facts] == [said] * (said is not None)
    size = {"unseen": unseen, "drift": drift}.get(said, 0.0)
    assert all(text.startswith(f"{1e3 * size:.3f} mm of it") for _, text in facts)


@pytest.mark.parametrize(("misfit", "told"), [(3e-4, True), (1e-4, True), (4e-5, False)])
@pytest.mark.parametrize(("width", "how"), [(1, " (edbb plan --aim tracing)"), (3, "")])
def test_misfit_that_counts_is_one_line_how_much_where_and_what_to_measure(misfit, told, width, how):
    """Without a tenth of the square 5 % less would be stated: less nobody notices."""
    parts = ErrorParts(seen=1e-4, unseen=2e-4, misfit=misfit, drift=0.0)
    place = largest_misfit(squares((2, 1.0, 2.0), (4, -2.0, -1.0)), Q)
    found = SimpleNamespace(fit=SimpleNamespace(model=SimpleNamespace(width=width)), noise_floor=None)
    lines = list(_misfit_facts(found, SimpleNamespace(parts=parts, unexplained=place)))
    where = ", ".join(r.text for r in place.ranges)
    line = (
        f"{1e3 * misfit:.3f} mm of the error is what unnamed causes leave open, most with {where}: measure there{how}"
    )
    assert lines == [("misfit", line)] * told
    assert not list(_misfit_facts(found, SimpleNamespace(parts=parts, unexplained=None)))


@pytest.mark.parametrize(
    ("floor", "more"), [(None, ", 20 poses twice ([plan] repeat): that tells it from noise"), (1e-5, "")]
)
def test_misfit_that_is_alike_everywhere_may_be_noise_unless_poses_were_repeated(floor, more):
    parts = ErrorParts(seen=1e-4, unseen=1e-4, misfit=3e-4, drift=0.0)
    found = SimpleNamespace(fit=SimpleNamespace(model=SimpleNamespace(width=3)), noise_floor=floor)
    ((_, line),) = _misfit_facts(found, SimpleNamespace(parts=parts, unexplained=largest_misfit(squares(), Q)))
    assert line.endswith(f"alike everywhere: measure more all over the workspace{more}")
