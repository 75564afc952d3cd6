"""The forward selection ends, whatever what is added drives out again."""

from types import SimpleNamespace

import pytest

from planner.effects.effect import Role
from planner.tracing import search as search_module


def ripple(repeat=1):
    """A gear's wave, of which a joint may have several; the name of a second one ends in its number."""
    suffix = "" if repeat == 1 else f" ({repeat})"
    return SimpleNamespace(name=f"gear ripple{suffix}, joint 2", has=lambda role: role is Role.REPEATABLE)


def state(*names):
    """A state with effects of these names."""
    return SimpleNamespace(
        effects=tuple(SimpleNamespace(name=n, has=lambda role: False) for n in names), names=frozenset(names),
        structure=frozenset((n, 2) for n in names),
    )  # fmt: skip


@pytest.mark.parametrize("way", ["a second of its kind", "two of its kind at once", "the same with other parameters"])
def test_what_drives_out_what_brought_it_in_is_not_tried_for_ever(monkeypatch, way):
    start = state("gear ripple, joint 2")
    added = {
        "a second of its kind": ("gear ripple (2), joint 2",),
        "two of its kind at once": ("gear ripple (2), joint 2", "gear ripple (3), joint 2"),
        "the same with other parameters": (),
    }[way]
    tries = []

    def best_step(context, known, test, likely):
        tries.append([c.effect.name for c in likely])
        assert len(tries) < 10, "the same step is tried again and again"
        return state("gear ripple, joint 2", *added) if len(tries) < 3 or added else None

    candidate = SimpleNamespace(effect=ripple(), merit=1.0, place_in_order=-1.0, log_p=-100.0)
    context = SimpleNamespace(
        excluded=set(), steppables=(), dictionary=None, report=lambda _: None, prune=lambda s: s,
        settle=lambda before, after: start, score_test=lambda s: SimpleNamespace(scatter=1.0),
        change_test=lambda s: SimpleNamespace(scatter=1.0),
        rejected=SimpleNamespace(may_try=lambda c, scatter: True),
        fit_context=SimpleNamespace(run=SimpleNamespace(continuous=False)),
    )  # fmt: skip
    monkeypatch.setattr(search_module, "rank_changes", lambda *_: [])
    monkeypatch.setattr(search_module, "rank_candidates", lambda *_: [candidate])
    monkeypatch.setattr(search_module, "relocate_steps", lambda context, after, steppables: after)
    monkeypatch.setattr(search_module, "best_step", best_step)
    monkeypatch.setattr(search_module, "number_repeat", lambda effect, effects: ripple(1 + len(effects)))
    path = search_module._forward_selection(context, [start])
    assert path == [start]
    assert tries
