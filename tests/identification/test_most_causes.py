"""``--most-causes N``: search, draws and document hold no more causes with a name than asked for."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.identification.pipeline import FitSettings, identify
from planner.inference.posterior_background import has_name
from planner.inference.posterior_draws import ChainLimits, RandomEffects, SizeDraw, SizePrior, draw_sizes
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.identification.few_draws import few_draws
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.draw import random_run
from tests.simulation.generator.runs import tracker

SLAB = SizePrior(np.array([0.0, 0.3, 1.0, 3.0]), np.array([0.7, 0.1, 0.1, 0.1]), pool=1)


@pytest.mark.parametrize("most", [0, 1, 2])
def test_no_draw_has_more_causes_than_asked_for_and_the_likeliest_stay(most):
    """Three families act, the second most; the fourth has no name and does not count."""
    rng = np.random.default_rng(4)
    family = np.repeat(np.arange(5), 3)
    columns = rng.normal(size=(120, 15))
    size = np.array([1.0, 3.0, 0.5, 1.0, 0.0])
    y = columns @ (size[family] * rng.choice([-1.0, 1.0], 15)) + rng.normal(size=120)
    model = RandomEffects(
        columns, y, family, np.ones((120, 1)), (SLAB,) * 5, np.eye(1), limited=(0, 1, 2, 4), most=most
    )
    draws = draw_sizes(model, SizeDraw(np.zeros(5), np.zeros(1)), sweeps=60)
    acting = np.stack([d.factors > 0 for d in draws])
    assert acting[:, [0, 1, 2, 4]].sum(axis=1).max() == most
    assert acting[:, 3].all()
    assert acting[-1, [1, 0][:most]].all()


def test_what_the_cell_declares_does_not_count():
    limits = ChainLimits(most_causes=1, declared=("joint compliance",))
    assert limits.counts("gear ripple, joint 2")
    assert not limits.counts("joint compliance, joint 2")
    assert not ChainLimits().counts("gear ripple, joint 2")


@pytest.mark.slow
@few_draws()
def test_a_run_with_two_causes_is_told_by_one(tmp_path):
    made = random_run(tracker, Arm.from_toml("kuka-kr6-r700"), 6, ["reducer-ripple", "encoder-once"], 3.0, n_poses=60)
    run, cell = made.write(tmp_path)[:2]
    cell = load_cell(str(cell), planning=False)
    found = identify(load_runs([run], 6), cell, settings=FitSettings(most_causes=1), tracer=trace)
    record = found.released.posterior.record
    named = [k for k, p in enumerate(record.effects.priors) if p.factors[0] == 0.0 and has_name(record.names[k])]
    assert max(np.count_nonzero(d.factors[named]) for d in record.draws) == 1
    assert len([f for f in found.findings if f.effect != "unnamed"]) == 1
    assert len(found.stages[-1].effects) == 1
