"""One list of causes: many of one kind are one, the likeliest stands first, and nothing of them is lost."""

import re

import numpy as np
import pytest

from planner.model.finding import Finding
from planner.model.finding_groups import group_text, list_causes


def step(sample, value, on="tool point", std=2e-5):
    return Finding(
        effect="step", on=on, value=value, std=std, unit="m", gain=value, after_sample=sample, note=f"s{sample}"
    )


def of_joint(joint, value, effect="backlash", unit="rad", **more):
    return Finding(effect=effect, on=f"joint {joint}", value=value, std=value / 10, unit=unit, note=f"j{joint}", **more)


def test_a_reflector_seated_anew_many_times_is_one_thing():
    """Thirteen seats of 0.3 mm each: one sentence, whose size covers the truth in 95 of 100 runs or so."""
    rng, inside = np.random.default_rng(1), 0
    for _ in range(400):
        sizes = np.abs(0.3e-3 * rng.standard_normal(13)) + 1e-9
        (cause,) = list_causes(step(10 * k, v) for k, v in enumerate(sizes, start=1))
        inside += abs(cause.value - 0.3e-3) < 1.96 * cause.std
        least, most, mean = map(
            float, re.search(r"13 times, by (\S+) to (\S+) mm \(root mean square (\S+)\)", cause.note).groups()
        )
        assert (least, most) == pytest.approx((1e3 * sizes.min(), 1e3 * sizes.max()), rel=0.005)
        assert mean == pytest.approx(1e3 * cause.value, rel=0.005)
    assert 0.9 < inside / 400 < 0.99
    assert len(cause.members) == 13
    assert cause.title == "step, tool point, 13 times"
    assert all(str(10 * k) in cause.note.rpartition("samples ")[2].split(", ") for k in range(1, 14))


def test_one_sentence_lists_each_joint():
    found = list_causes([of_joint(5, 3e-5), of_joint(1, 1e-5), step(9, 1e-3), of_joint(2, 2e-5)])
    assert [len(f.each) for f in found] == [1, 3]  # the step takes away, the play nothing
    assert found[1].title == "backlash, joints 1, 2, 5"
    assert found[1].note == (
        "backlash of 3 joints, 10 to 30 µrad (root mean square 21.5): joint 1 10.0 ± 1.0 µrad, "
        "joint 2 20.0 ± 2.0 µrad, joint 5 30 ± 3 µrad"
    )
    # 1, 2, 3 of 1e-5, less what their deviations add: 14 - 0.14 over 3
    assert found[1].value == pytest.approx(np.sqrt((14 - 0.14) / 3) * 1e-5)


def test_no_deviation_of_what_they_have_in_common_stands_behind_their_sizes():
    """Each is known to 0.5 %; the spread of three draws is known to 40 %, which is no deviation of any of them."""
    given = ((1, 150.2, 0.48), (2, 121.04, 0.65), (5, 297.7, 1.9))
    own = [of_joint(k, 1e-6 * v, probability=0.99).model_copy(update={"std": 1e-6 * s}) for k, v, s in given]
    (cause,) = list_causes(own)
    assert group_text(cause.members) == "backlash of 3 joints, 121 to 298 µrad (root mean square 205)"
    assert cause.note.startswith(group_text(cause.members) + ": joint 1 150.20 ± 0.48 µrad, joint 2 121.04 ± 0.65 µrad")
    assert re.findall(r"± ([\d.]+)", cause.note) == ["0.48", "0.65", "1.9"]


def test_what_none_of_them_has_for_a_rival_is_said_as_of_one():
    """An empty list says that rivals were looked for; that none were, in files of before, is no key."""
    looked = list_causes([of_joint(k, 1e-5, rival_probabilities=()) for k in (1, 2, 3)])[0]
    before = list_causes([of_joint(k, 1e-5) for k in (1, 2, 3)])[0]
    assert looked.model_dump(mode="json", by_alias=True)["rival_probabilities"] == []
    assert "rival_probabilities" not in before.model_dump(mode="json", by_alias=True)


def test_two_of_a_kind_and_other_kinds_stay_as_they_are():
    findings = [step(8, 3e-3, on="base"), step(7, 2e-3), step(3, 1e-3), of_joint(1, 1e-5), of_joint(2, 1e-5, "gear")]
    assert list_causes(findings) == tuple(findings)
    assert [f.title for f in findings] == [f"{f.effect}, {f.on}" for f in findings]


def test_the_likeliest_stands_first_and_of_as_likely_what_takes_most_away():
    gains = (1e-5, 4e-5, 3e-5, 2e-5, 5e-5, 6e-5, 3e-5)
    chances = (0.95, 0.6, None, 0.5, 0.49, 0.02, 0.603)
    names = ("a", "b", "c", "d", "e", "f", "g")
    given = [
        of_joint(k, 1e-5, n, gain=g, probability=p)
        for k, (n, g, p) in enumerate(zip(names, gains, chances, strict=True))
    ]
    found = list_causes(given)
    assert "".join(f.effect for f in found) == "cabgdef"
    assert [f.grade for f in found] == ["found"] * 2 + ["likely"] * 3 + ["doubtful"] * 2
    assert list_causes(found) == found


def test_rivals_of_all_of_them_are_kept():
    own = [
        of_joint(
            k, 1e-5, rivals=(f"backlash, joint {k + 3}", "soft base", "drift, arm"), rival_probabilities=(0.2, p, q)
        )
        for k, p, q in ((1, 0.1, 0.0), (2, 0.05, 0.3), (3, 0.0, 0.1))
    ]
    (cause,) = list_causes(own)
    assert (cause.rivals, cause.rival_probabilities) == (("drift, arm", "soft base"), (0.3, 0.1))
    assert [f.rivals for f in cause.members] == [f.rivals for f in own]


def test_the_document_has_them_as_one_random_effect():
    """Sizes of 3, 4 and 12: root mean square 7.5; the file holds each of them, in its units."""
    found = [of_joint(5, 3e-4), step(9, 1e-3), of_joint(1, 4e-4), of_joint(2, 12e-4)]
    exact = [
        f.model_copy(update={"std": 0.0, "probability": p}) for f, p in zip(found, (0.9, 1.0, 0.8, 0.95), strict=True)
    ]
    cause = list_causes(exact)[1]
    assert (cause.effect, cause.on, cause.probability) == ("backlash", "joints 1, 2, 5", 0.8)
    assert cause.value == pytest.approx(np.sqrt((9 + 16 + 144) / 3) * 1e-4)
    assert cause.std == pytest.approx(cause.value / np.sqrt(6))
    written = cause.model_dump(mode="json", by_alias=True)
    assert (written["unit"], written["grade"]) == ("deg", "likely")
    assert written["value"] == pytest.approx(np.degrees(cause.value))
    assert [m["value"] for m in written["members"]] == pytest.approx(np.degrees([3e-4, 4e-4, 12e-4]))
    again = Finding.model_validate(written)
    assert [m.on for m in again.members] == ["joint 5", "joint 1", "joint 2"]
    assert [m.value for m in again.members] == pytest.approx([3e-4, 4e-4, 12e-4])
    assert (again.value, again.std) == pytest.approx((cause.value, cause.std))
    assert "members" not in exact[1].model_dump(mode="json", by_alias=True)


def test_one_doubtful_joint_makes_no_doubt_of_the_others():
    own = [of_joint(k, 1e-5, probability=p) for k, p in ((1, 0.99), (2, 0.97), (3, 0.95), (6, 0.01))]
    sure, doubtful = list_causes(own)
    assert (sure.grade, sure.probability, len(sure.members)) == ("found", 0.95, 3)
    assert (doubtful.grade, doubtful.title) == ("doubtful", "backlash, joint 6")
