"""A process that stands by draws what would be drawn here, once for the same page, and tells why it could not."""

from dataclasses import replace

import numpy as np
import pytest

from planner.report.chart import Chart, Panel, Series
from planner.report.page import Report
from planner.report.standby import draw_pictures, drawing_process, stand_by

LINE = Panel("a line", "x", "y", (Series("one", np.arange(3.0), np.arange(3.0), "#000000"),))
PAGE = Report("plan.html.j2", {}, (Chart("line", "A line", "drawn", (LINE,)),))


@pytest.fixture
def process(monkeypatch):
    monkeypatch.setattr("planner.common.second_process.available_threads", lambda: 2)
    with stand_by():
        yield drawing_process()
    assert drawing_process() is None


@pytest.mark.posix
def test_its_pictures_are_those_that_are_drawn_here_and_are_drawn_once(process):
    PAGE.draw_beside()
    again = replace(PAGE)
    again.draw_beside()
    assert PAGE.pngs == again.pngs == draw_pictures(PAGE.charts, small=False)
    assert len(process._drawn) == 1


def test_the_error_that_ended_it_is_told(process):
    line = replace(LINE.series[0], y=np.arange(2.0))
    wrong = replace(PAGE, charts=(replace(PAGE.charts[0], panels=(replace(LINE, series=(line,)),)),))
    with pytest.raises(ValueError, match="same first dimension"):
        _ = wrong.pngs
