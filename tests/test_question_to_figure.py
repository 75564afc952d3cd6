"""The notebook from the question to the figure: own table, gauge, effect, poses, a sweep with error bars, and a PDF."""

from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest

import planner.cell.gauge_registry as gauges
import planner.effects.basis as basis
import planner.effects.catalogue as effects
from planner.effects.phi_keys import positions_in

BOOK = Path(__file__).parent.parent / "examples" / "question_to_figure.ipynb"


@pytest.fixture
def registered():
    """What the notebook registers goes with the test."""
    gauges.gauge_kinds()
    effects.effect_kinds()
    kinds, lists = dict(gauges._KINDS), [(kept, list(kept)) for kept in (effects._REGISTRY, basis.FUNCTIONS)]
    yield
    gauges._KINDS.clear()
    gauges._KINDS.update(kinds)
    for kept, before in lists:
        kept[:] = before
    positions_in.cache_clear()


@pytest.mark.slow
@pytest.mark.usefixtures("registered")
def test_the_notebook_runs_each_definition_twice_and_ends_in_a_figure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    book = nbformat.read(BOOK, as_version=4)
    assert not any(c.get("outputs") for c in book.cells)  # what is shown is made anew
    made: dict[str, Any] = {"__name__": "notebook"}
    for cell in (c for c in book.cells if c.cell_type == "code"):
        text = cell.source.replace('"poses": [40, 80]', '"poses": [40]').replace("[20, 60, 200]", "[20, 200]")
        for _ in range(2 if "register" in text else 1):
            exec(compile(text, cell.id, "exec"), made)
    assert made["cell"].gauge.kind == "own-wire"
    seen = made["seen"]
    assert {"elbow_sin", "elbow_cos"} <= set(seen.names)
    tall = seen.jacobian.reshape(-1, len(seen.names)) * [p.prior for p in seen.model.parameters]
    np.testing.assert_allclose(made["mu"], np.linalg.svd(tall, compute_uv=False), rtol=1e-8, atol=1e-14)
    assert made["efficiency"]["own"] < made["efficiency"]["chosen"] <= 1.0
    assert made["found"].comparisons.filter(made["found"].comparisons["along"] == "gauge.noise_um")["differs"].all()
    bars = [c for c in made["ax"].containers if hasattr(c, "has_yerr") and c.has_yerr]
    assert len(bars) == 1
    assert (tmp_path / "own_arm.pdf").read_bytes().startswith(b"%PDF")
