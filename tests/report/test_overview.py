"""The page of a study: keys in a column of their own, sentences whole."""

from itertools import pairwise

import pytest

from planner.cell.reading import load_cell
from planner.report.page import report_overview


@pytest.mark.parametrize(
    ("line", "key", "text"),
    [
        ("  The cell's own circle would leave c6 open.", "", "The cell&#39;s own circle would leave c6 open."),
        ("  found       4 places know it", "found", "4 places know it"),
        ("  1.          attach the bar", "1.", "attach the bar"),
        ("              and then", "", "and then"),
    ],
)
def test_only_what_stands_in_a_column_of_its_own_is_a_key(line, key, text):
    page = report_overview("Places", load_cell("kuka-kr6-r700/edbb"), f"head\n{line}", (), ()).html()
    cells = [part.partition("</td>")[0].rpartition(">")[2] for part in page.split("<td")[1:]]
    assert (key, text) in list(pairwise(cells))
