"""Many findings of one kind are said as one, and nothing of them is lost."""

import re

import numpy as np

from planner.model.finding_groups import group_findings
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
    assert found[0].note == "backlash of 3 joints (1: 10.0 ± 1.0 µrad, 2: 20.0 ± 2.0 µrad, 5: 30 ± 3 µrad)"


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
