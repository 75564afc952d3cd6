"""Nothing of a printed picture is cut off: its edge is blank; and its colours mean what they mean on the page."""

import re
from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread

from planner.report.chart import BLACK, GREEN, RED, Chart, ColourField, Panel, Series
from planner.report.matplotlib_backend import chart_png
from planner.report.svg_backend import chart_html, field_pixels


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


@pytest.mark.slow
def test_beside_a_scale_there_is_room_for_labels():
    field = ColourField(np.arange(4.0), np.arange(4.0), 0.014 + 0.001 * np.arange(16.0).reshape(4, 4), "moved (mm)")
    panels = [Panel("", "reach (mm)", "height (mm)", (), field=field, x_range=(0.0, 3.0), y_range=(0.0, 3.0))]
    panels += [Panel("", "joint", "moved by (mm, rms)", (line("", RED),)) for _ in range(3)]
    seen = ink(Chart("c", "", "", tuple(panels), columns=2))
    assert not seen[:, :4].any()


def test_a_field_is_darkest_where_it_is_largest_on_the_page():
    pixels = field_pixels(ColourField(np.arange(2.0), np.arange(2.0), np.array([[0.0, 1.0], [0.5, np.nan]]), "moved"))
    assert pixels[0, 0, :3].sum() > pixels[1, 0, :3].sum() > pixels[0, 1, :3].sum()
    assert pixels[:, :, 3].tolist() == [[255, 255], [255, 0]]


@pytest.mark.slow
def test_numbers_at_a_scale_of_colours_are_whole():
    """They read 0.2, 0.1, 0.1 where 0.225, 0.175, 0.125 were cut off at the edge."""
    field = ColourField(np.arange(4.0), np.arange(4.0), 0.00125 + 0.00025 * np.arange(16.0).reshape(4, 4), "moved (mm)")
    panel = Panel("", "reach (mm)", "", (), field=field, x_range=(0.0, 3.0), y_range=(0.0, 3.0))
    assert not ink(Chart("c", "", "", (panel, panel), columns=2))[:, -4:].any()


@pytest.mark.parametrize(
    ("low", "high", "ends"), [(0.05, 0.2, ("0.04", "0.20")), (0.0, 4.36, ("0", "5")), (0.125, 0.225, ("0.12", "0.24"))]
)
def test_numbers_at_a_scale_of_colours_are_few_round_and_distinct(low, high, ends):
    field = ColourField(np.arange(2.0), np.arange(2.0), np.array([[low, high], [high, np.nan]]), "error (mm)")
    values, texts = field.ticks
    assert (texts[0], texts[-1]) == ends
    assert (values[0], values[-1]) == pytest.approx(field.span)
    assert len(set(texts)) == len(texts) <= 10
    assert [float(t) for t in texts] == pytest.approx(values), "rounded away from nothing"
    panel = Panel("", "reach (mm)", "", (), field=field)
    assert all(
        f"<span>{end}</span>" in chart_html(Chart("c", "", "", (panel,))) for end in (ends[0], f"{ends[1]}\u00a0mm")
    )


def test_an_even_field_looks_even():
    field = ColourField(np.arange(2.0), np.arange(2.0), np.array([[0.419, 0.422], [0.42, np.nan]]), "misfit (mm)")
    low, high = field.span
    assert low < 0.38 < 0.46 < high
    assert ColourField(np.arange(2.0), np.arange(2.0), np.eye(2), "").span == (0.0, 1.0)


def test_a_line_has_a_gap_where_nothing_is_known_and_dots_are_drawn_once():
    x, y = np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    drawn = chart_html(Chart("c", "", "", (Panel("", "x", "y", (Series("", x, y, BLACK),)),)))
    (way,) = re.findall(r'class="line" d="([^"]+)"', drawn)
    assert way.count("M") == 2
    assert way.count("L") == 2
    twice = Series("", np.zeros(7), np.zeros(7), BLACK, "points")
    drawn = chart_html(Chart("c", "", "", (Panel("", "x", "y", (twice,), x_range=(-1, 1), y_range=(-1, 1)),)))
    assert re.findall(r'class="dots"[^>]* d="([^"]+)"', drawn) == ["M1000 1000h0"]
    nothing = Series("", np.empty(0), np.empty(0), BLACK)
    assert 'class="line"' not in chart_html(Chart("c", "", "", (Panel("", "x", "y", (nothing,)),)))
