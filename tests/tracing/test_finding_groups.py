"""Many findings of one kind are said as one, and nothing of them is lost."""

import re

import numpy as np
import pytest

from planner.model.beside_findings import ManyOfOneKind
from planner.model.finding_groups import group_findings, many_of_one_kind
from planner.model.identification_document import Finding


def step(sample, value, on="tool point", std=2e-5):
    return Finding(
        effect="step", on=on, value=value, std=std, unit="m", gain=value, after_sample=sample, note=f"s{sample}"
    )


def of_joint(joint, value, effect="backlash", unit="rad"):
    return Finding(effect=effect, on=f"joint {joint}", value=value, std=value / 10, unit=unit, note=f"j{joint}")


def test_a_reflector_seated_anew_many_times_is_one_thing():
    """Thirteen seats of 0.3 mm each: one sentence, whose size covers the truth in 95 of 100 runs or so."""
    rng, inside = np.random.default_rng(1), 0
    for _ in range(400):
        sizes = np.abs(0.3e-3 * rng.standard_normal(13)) + 1e-9
        (group,) = group_findings(step(10 * k, v) for k, v in enumerate(sizes, start=1))
        each, std = map(float, re.search(r"13 times, by ([\d.]+) ± ([\d.]+) mm each", group.note).groups())
        inside += abs(each - 0.3) < 1.96 * std + 0.005  # as it is rounded
    assert 0.9 < inside / 400 < 0.99
    assert len(group.findings) == 13
    assert group.title == "step, tool point, 13 times"
    assert all(str(10 * k) in group.note.rpartition("samples ")[2].split(", ") for k in range(1, 14))


def test_one_sentence_lists_each_joint():
    found = group_findings([of_joint(5, 3e-5), of_joint(1, 1e-5), step(9, 1e-3), of_joint(2, 2e-5)])
    assert [len(g.findings) for g in found] == [3, 1]
    assert found[0].note == (
        "backlash of 3 joints, 21 ± 9 µrad each (root mean square; 1: 10.0 ± 1.0 µrad, 2: 20.0 ± 2.0 µrad, "
        "5: 30 ± 3 µrad)"
    )


def test_two_of_a_kind_and_other_kinds_stay_as_they_are():
    findings = [step(3, 1e-3), step(7, 1e-3), step(8, 1e-3, on="base"), of_joint(1, 1e-5), of_joint(2, 1e-5, "gear")]
    found = group_findings(findings)
    assert [g.note for g in found] == [f.note for f in findings]
    assert [g.title for g in found] == [f"{f.effect}, {f.on}" for f in findings]
    assert [g.gain for g in found] == [f.gain for f in findings]


def test_rivals_of_all_of_them_are_kept():
    own = [
        of_joint(k, 1e-5).model_copy(update={"rivals": (f"backlash, joint {k + 3}", "soft base")}) for k in (1, 2, 3)
    ]
    (group,) = group_findings(own)
    assert group.rivals == ("soft base",)


def test_the_document_has_them_as_one_random_effect():
    """Sizes of 3, 4 and 12: root mean square 7.5; which findings they are is told by their positions."""
    found = [of_joint(5, 3e-4), step(9, 1e-3), of_joint(1, 4e-4), of_joint(2, 12e-4)]
    exact = [
        f.model_copy(update={"std": 0.0, "probability": p}) for f, p in zip(found, (0.9, 1.0, 0.8, 0.95), strict=True)
    ]
    (group,) = many_of_one_kind(exact)
    assert (group.effect, group.on, group.findings, group.probability) == ("backlash", "joints", (0, 2, 3), 0.8)
    assert group.value == pytest.approx(np.sqrt((9 + 16 + 144) / 3) * 1e-4)
    assert group.std == pytest.approx(group.value / np.sqrt(6))
    again = ManyOfOneKind.model_validate(group.model_dump(mode="json", by_alias=True))
    assert again.findings == group.findings
    assert (again.value, again.std) == pytest.approx((group.value, group.std))
    assert many_of_one_kind(found[:3]) is None


def test_one_doubtful_joint_makes_no_doubt_of_the_others():
    own = [
        of_joint(k, 1e-5).model_copy(update={"probability": p}) for k, p in ((1, 0.99), (2, 0.97), (3, 0.95), (6, 0.01))
    ]
    sure, doubtful = group_findings(own)
    assert (sure.grade, sure.probability, len(sure.findings)) == ("found", 0.95, 3)
    assert (doubtful.grade, doubtful.title) == ("doubtful", "backlash, joint 6")
