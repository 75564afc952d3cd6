"""Options that a plan cannot follow are refused before any work, never passed over."""

import pytest

from tests.command import edbb


@pytest.mark.parametrize(
    ("cell", "words", "message"),
    [
        (
            "kuka-kr6-r700/trical",
            ["--separate", "i.json"],
            "--separate chooses the poses of a bar, the gauge here is 'tr",
        ),
        ("kuka-kr6-r700/tracker", ["--separate", "i.json"], "the gauge here is 'tracker'; leave it out"),
        ("kuka-kr6-r700/trical", ["--aim", "tracing"], "the aim 'tracing' is for a bar"),
        (
            "kuka-kr6-r700/tracker",
            ["--fixtures", "2"],
            "--fixtures is for a bar, the gauge here is 'tracker'",
        ),
        ("comau-nj130/edbb", ["--aim", "tracing", "--separate", "i.json"], "leave one out"),
        ("comau-nj130/edbb", ["--aim", "tracing", "--method", "pruning"], "by the error that is left: leave one out"),
        ("comau-nj130/edbb", ["--method", "pruning", "--separate", "i.json"], "and so does --method: leave one out"),
        ("kuka-kr6-r700/trical", ["--method", "pruning"], "each ball is to have as many: leave the method out"),
    ],
)
def test_what_cannot_be_asked_of_a_cell(cell, words, message, tmp_path):
    done = edbb("plan", cell, "-o", tmp_path / "out", *words)
    assert done.returncode == 2
    assert message in done.screen
    assert not (tmp_path / "out").exists()
