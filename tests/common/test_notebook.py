"""In a notebook a function shows its progress by itself; elsewhere, and where progress is given, it does not."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from planner.common.calls import Call, ProgressKeyword, called_with
from planner.common.progress import no_progress

IPython = pytest.importorskip("IPython")


@dataclass(frozen=True)
class WalkCall(Call):
    """Walk."""

    verb = "walk"
    line = "Walk."
    function = "tests.common.test_notebook:walk"
    progress: ProgressKeyword = no_progress


@called_with(WalkCall)
def walk(asked: WalkCall) -> str:
    """Walk."""
    asked.progress("walking", 1, 2)
    asked.progress("resting", 0, 0)
    return "there"


@pytest.fixture
def shown(monkeypatch):
    """What a notebook was asked to show, in order."""
    lines = []

    def display(what, display_id):
        lines.append(what.data)
        return SimpleNamespace(update=lambda what: lines.append(what.data))

    monkeypatch.setattr(IPython.display, "display", display)
    return lines


def test_a_notebook_shows_the_stages_and_clears_the_line(monkeypatch, shown):
    monkeypatch.setattr(IPython, "get_ipython", lambda: SimpleNamespace(kernel=True))
    assert walk() == "there"
    first, second, last = shown
    assert "walking" in first
    assert "1 of 2" in first
    assert "resting" in second
    assert last == ""


@pytest.mark.parametrize("shell", [None, SimpleNamespace()])
def test_a_terminal_shows_nothing_of_it(monkeypatch, shown, shell):
    monkeypatch.setattr(IPython, "get_ipython", lambda: shell)
    assert walk() == "there"
    assert shown == []


def test_who_gives_progress_is_told_it(monkeypatch, shown):
    monkeypatch.setattr(IPython, "get_ipython", lambda: SimpleNamespace(kernel=True))
    told = []
    walk(progress=lambda *what: told.append(what))
    assert told == [("walking", 1, 2), ("resting", 0, 0)]
    assert shown == []
