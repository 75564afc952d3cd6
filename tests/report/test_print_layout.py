"""Nothing of a printed picture is cut off: its edge is blank."""

from io import BytesIO

import numpy as np
from matplotlib.image import imread

from planner.report.chart import BLACK, GREEN, RED, Chart, ColourField, Panel, Series
from planner.report.matplotlib_backend import chart_png


def ink(chart):
    """Where a picture is not blank, (rows, columns) bool."""
    return imread(BytesIO(chart_png(chart)))[:, :, :3].min(axis=2) < 0.9


def line(name, colour):
    return Series(name, np.linspace(0.0, 1.0, 5), np.linspace(0.0, 0.0175, 5), colour)


def test_a_title_above_its_legend_is_whole():
    series = tuple(line(name, colour) for name, colour in (("as fitted", RED), ("mean", BLACK), ("step", GREEN)))
    seen = ink(Chart("c", "", "", tuple(Panel(title, "x", "y", series) for title in ("before", "after")), columns=2))
    assert not seen[:4].any()
    assert not seen[:, :4].any()


def test_beside_a_scale_there_is_room_for_labels():
    field = ColourField(np.arange(4.0), np.arange(4.0), 0.014 + 0.001 * np.arange(16.0).reshape(4, 4), "moved (mm)")
    panels = [Panel("", "reach (mm)", "height (mm)", (), field=field, x_range=(0.0, 3.0), y_range=(0.0, 3.0))]
    panels += [Panel("", "joint", "moved by (mm, rms)", (line("", RED),)) for _ in range(3)]
    seen = ink(Chart("c", "", "", tuple(panels), columns=2))
    assert not seen[:, :4].any()
