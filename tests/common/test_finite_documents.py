"""No number of a document is nan or infinite, wherever it stands and whichever library wrote it."""

import json
from pathlib import Path

import polars as pl
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from planner.common.files import document_text, write_text, write_together
from planner.common.finite_documents import NotFiniteError, check_finite

NOT_FINITE = st.sampled_from([float("nan"), float("inf"), float("-inf")])
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
WORDS = st.sampled_from(["name", "nan", "inf", "information", "NaN mm", "-Infinity", "Nanjing, inf", '"NaN": 1'])
LEAVES = NUMBERS | WORDS | st.booleans()
TREES = st.recursive(
    LEAVES, lambda part: st.lists(part, max_size=3) | st.dictionaries(WORDS, part, max_size=3), max_leaves=8
)
PAGE = "<html><head><script>var nan = NaN, s = x > nan;</script></head><body>{}</body></html>"
WRITERS = {
    "json": lambda content: json.dumps(content),
    "toml": lambda content: tomli_w.dumps(content),
}


def holding(tree, value):
    """A document that holds a value somewhere beside a tree."""
    return {"first": tree, "deep": [{"name": "a", "size_mm": [1.0, value]}]}


@pytest.mark.slow
@given(tree=TREES, value=NUMBERS)
def test_finite_documents_pass_whatever_words_they_hold(tree, value):
    for kind, write in WRITERS.items():
        check_finite(Path(f"a.{kind}"), write(holding(tree, value)).encode())
    assert json.loads(document_text(holding(tree, value))) == holding(tree, value)


@given(tree=TREES, value=NOT_FINITE)
def test_a_document_with_nan_is_refused_by_its_place(tree, value):
    for kind, write in WRITERS.items():
        with pytest.raises(NotFiniteError, match=rf"a\.{kind}: deep\.0\.size_mm\.1 came out as no finite number"):
            check_finite(Path(f"a.{kind}"), write(holding(tree, value)).encode())
    with pytest.raises(NotFiniteError, match=r"deep\.0\.size_mm\.1 came"):
        document_text(holding(tree, value))


@pytest.mark.slow
@given(rows=st.lists(NUMBERS, min_size=1, max_size=4), value=NOT_FINITE)
def test_a_table_with_nan_is_refused_by_line_and_column(rows, value):
    names = pl.Series("name", [f"nanometre {k}" for k in range(len(rows) + 1)])
    good, bad = (
        pl.DataFrame([names, pl.Series("x_mm", [*rows, last]), pl.Series("inf_mm", [1.0] * (len(rows) + 1))])
        for last in (0.5, value)
    )
    check_finite(Path("a.csv"), good.write_csv().encode())
    with pytest.raises(NotFiniteError, match=rf"a\.csv: line {len(rows) + 2}, column 2 "):
        check_finite(Path("a.csv"), bad.write_csv().encode())


@pytest.mark.parametrize("text", ["nan %", "2.0 ± nan", "up to inf mm", "-inf µm", "<td> nan </td>", "nan deg,"])
def test_a_page_with_nan_is_refused(text):
    with pytest.raises(NotFiniteError, match=r"a\.html"):
        check_finite(Path("a.html"), PAGE.format(text).encode())


@pytest.mark.parametrize("text", ["1.0 mm", "run-inf.csv", "inf-2 mm", "<td>Nan</td>", "information %", "nan_mm"])
def test_a_page_with_words_alone_passes(text):
    check_finite(Path("a.html"), PAGE.format(text).encode())


def test_nothing_is_written_where_one_of_several_is_refused(tmp_path):
    with pytest.raises(NotFiniteError, match=r"b\.json: x"):
        write_together([(tmp_path / "a.toml", b"x = 1.0\n"), (tmp_path / "b.json", b'{"x": NaN}')])
    with pytest.raises(NotFiniteError) as caught:
        write_text(tmp_path / "c.csv", "x_mm\nnan\n")
    assert caught.value.exit_code == 1
    assert list(tmp_path.iterdir()) == []
    write_text(tmp_path / "program.src", "; nan, inf\n")  # no document of numbers
