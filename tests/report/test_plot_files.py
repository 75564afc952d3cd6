"""A plot is written in the format of its suffix, the same bytes each time, and its axes may be drawn on first."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.report.chart import BLUE, Chart, Panel, Series
from planner.report.matplotlib_backend import chart_plot

STARTS = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


def plot():
    x = np.linspace(0.0, 1.0, 9)
    panel = Panel("residuals", "time (s)", "residual (mm)", (Series("one", x, x**2, BLUE),))
    return chart_plot(Chart("residuals", "Residuals", "", (panel, panel)))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", STARTS)
def test_the_suffix_says_the_format(tmp_path, suffix):
    files = [plot().save(tmp_path / f"{k}.{suffix}").read_bytes() for k in range(2)]
    assert files[0].startswith(STARTS[suffix])
    assert files[0] == files[1]


@pytest.mark.parametrize("name", ["fig", "fig.jpg", "fig.eps"])
def test_other_suffixes_are_refused_and_nothing_is_written(tmp_path, name):
    with pytest.raises(InputError, match=r"\.pdf"):
        plot().save(tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_is_drawn_on_the_axes_is_saved(tmp_path):
    made = plot()
    assert [ax.get_title(loc="left") for ax in made.axes] == ["residuals", "residuals"]
    made.axes[0].axhline(0.5, label="limit of arm 3")
    made.axes[0].set_xlabel("time of arm 3 (s)")
    text = made.save(tmp_path / "fig.svg").read_text()
    assert text != plot().save(tmp_path / "other.svg").read_text()
    assert made.save(tmp_path / "fig.png").read_bytes() != plot().png
