"""A run that is more than one piece is searched by a part of it, and every stage that came is judged on all of it."""

import numpy as np
import pytest

import planner.inference.stages as stages
from planner.fit.problem import FitProblem
from planner.model.identification_document import Metrics
from planner.tracing.trace import trace
from tests.tracing.test_state import begun
from tests.tracing.worlds import calibrated, effect


@pytest.mark.slow
def test_a_search_tries_on_a_part_and_is_judged_on_all(monkeypatch):
    ripple = effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0)
    start, bench, _ = begun(calibrated((ripple,), traced=False, seed=4))
    judged, tried = [], []
    bench = stages.replace(bench, judge=lambda fit: judged.append(fit) or Metrics.of(np.ones((3, 1))))
    monkeypatch.setattr(stages, "PIECE_SAMPLES", 150)
    monkeypatch.setattr(stages, "_fitted_samples", lambda model: 120)
    fit_stage = stages.FitContext.fit_stage
    monkeypatch.setattr(
        stages.FitContext, "fit_stage", lambda s, *a, **k: tried.append(len(s.run)) or fit_stage(s, *a, **k)
    )
    path, found = trace(start.fitted, bench, lambda _: None)
    assert [f.name for f in found.findings] == ["gear ripple, joint 3"]
    assert set(tried) == {120}
    assert len(judged) == len(path) < len(tried)
    for stage in path:
        assert len(stage.fit.problem) == 120
        assert stage.stage.validation is not None
        left = FitProblem.of(stage.fit.model, bench.run).residual(stage.fit.errors)
        assert np.allclose(stage.stage.residual, left, atol=1e-12)
        assert stage.stage.train == Metrics.of(left)
        assert stage.stage.held_residual.shape == left.shape
        assert stage.stage.held_out.rms > stage.stage.train.rms
