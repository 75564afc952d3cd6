"""The comparison itself: what it must see, and what it must pass over."""

import copy

import pytest

from tests.golden.compare import differences
from tests.golden.condense import short, table

VALUE = {"a": [1.0, 2.0], "long": [k / 7 for k in range(100)], "note": "the arm yields by 12 µm here", "id": "abc"}


def seen(change):
    other = copy.deepcopy(VALUE)
    change(other)
    return list(differences(short(VALUE), short(other)))


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v["a"].__setitem__(0, 1.0 + 1e-8),
        lambda v: v["long"].__setitem__(50, v["long"][50] + 1e-6),
        lambda v: v.update(long=[*v["long"][1:], v["long"][0]]),
        lambda v: v["long"].__setitem__(slice(10, 12), v["long"][11:9:-1]),
        lambda v: v.update(note="the arm yields by 13 µm here"),
        lambda v: v.update(id="abd"),
        lambda v: v.pop("id"),
        lambda v: v.update(more=1),
    ],
)
def test_a_change_is_seen(change):
    assert any(not d.wording for d in seen(change))


def test_rounding_is_not_a_change():
    assert not seen(lambda v: v["a"].__setitem__(0, 1.0 + 1e-12))
    assert not seen(lambda v: v["long"].__setitem__(50, v["long"][50] * (1 + 1e-13)))


def test_other_words_are_told_apart_from_other_numbers():
    (only,) = seen(lambda v: v.update(note="the arm gives way by 12 µm here"))
    assert only.wording


def test_a_table_is_compared_column_by_column():
    text = "# a: 1\nx,name\n" + "".join(f"{k / 3},{'ab'[k % 2]}\n" for k in range(50))
    assert not list(differences(table(text), table(text)))
    changed = text.replace("\n" + str(20 / 3), "\n" + str(20 / 3 + 1e-6))
    where = {d.where for d in differences(table(text), table(changed))}
    assert "columns/x/weighted" in where
    assert all(w.startswith(("columns/x", "some")) for w in where)
    assert any(d.where == "columns/name/words" for d in differences(table(text), table(text.replace(",a", ",c", 1))))
