"""An effect in one file that the package does not ship: simulated by its name in a truth file, and found by tracing."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import planner.effects.basis as basis
import planner.effects.catalogue as registry
from planner.common.errors import InputError
from planner.common.units import display_unit, format_value
from planner.effects.catalogue import catalogue, check_effect_name, effect_kinds, needs_of
from planner.effects.context import Context
from planner.effects.effect import Parameter, transform_move
from planner.effects.phi_keys import is_static, phi_from_key, positions_in
from planner.identification.pipeline import FitSettings, identify
from planner.tracing.trace import trace
from planner.workflow.plan_use import simulate
from tests.simulation.made import cell_in, truth_file, wide_plan

TRUTH = """
[noise]
gauge_um = 2.0
repeatability_mm = 0.002

[[effects]]
kind = "hose pull"
on = "joint 2 by joint 4"
value = 400
unit = "urad/rad"
"""
ROBOT = "kuka-kr6-r700"


@pytest.fixture
def hose(monkeypatch):
    """The file imported for this test alone."""
    effect_kinds()  # those that are shipped first
    monkeypatch.setattr(registry, "_REGISTRY", list(registry._REGISTRY))
    monkeypatch.setattr(basis, "FUNCTIONS", list(basis.FUNCTIONS))
    monkeypatch.setattr(importlib.import_module("planner.effects.phi_keys"), "FUNCTIONS", basis.FUNCTIONS)
    monkeypatch.delitem(sys.modules, "tests.effects.hose_pull", raising=False)
    yield importlib.import_module("tests.effects.hose_pull")
    positions_in.cache_clear()  # what is registered stays, but for this test


@pytest.mark.slow
@pytest.mark.usefixtures("hose")
def test_an_effect_in_one_file_is_simulated_and_found(tmp_path):
    plan = wide_plan(tmp_path, calibrate=90)
    run = simulate(plan, truth=truth_file(tmp_path, TRUTH), seed=1).run
    assert any("hose pull" in line for line in run.truth)
    found = identify(run, cell_in(tmp_path, ROBOT, 1, ()), settings=FitSettings(release=False), tracer=trace)
    names = [f"{f.effect}, {f.on}" for f in found.findings]
    assert names == ["hose pull, joint 2 by joint 4"]
    first = found.findings[0]
    assert abs(abs(first.value) - 400e-6) < 4 * first.std
    assert first.note.startswith("joint 2: the hose pulls once joint 4 has wound it up")
    assert found.stages[-1].held_out.rms < 0.5 * found.stages[-2].held_out.rms


@pytest.mark.slow
def test_its_name_and_its_key_are_known_with_the_file_only(hose, tmp_path):
    run = simulate(wide_plan(tmp_path, calibrate=10), seed=1).run
    cell = cell_in(tmp_path, ROBOT, 1, ())
    setup = importlib.import_module("planner.cell.cell").setup_of(cell)
    (first, *_) = [e for e in catalogue(setup, run.samples) if e.kind == "hose pull"]
    phi = first.make()[0].main_move.phi
    assert phi_from_key("hose:4", 6) == phi == hose.HoseWinding(3)
    assert phi.key == "hose:4"
    assert is_static(phi.key)
    assert phi.plot_variable(Context(setup, run.samples)).label == "joint 4: hose wound up (rad)"
    check_effect_name(first.name, 6, "here")
    assert needs_of("hose pull") == "poses with the wrist wound up"


def test_without_the_file_nobody_knows_it():
    assert "hose pull" not in effect_kinds()
    with pytest.raises(InputError, match="no effect"):
        check_effect_name("hose pull, joint 2", 6, "here")
    with pytest.raises(InputError, match="unknown"):
        phi_from_key("hose:4", 6)


def test_a_key_or_a_kind_that_is_taken_is_refused():
    before = list(basis.FUNCTIONS), list(registry._REGISTRY)
    for key in ("torque:JOINT", "torque:NUMBER", "(sine|torque):JOINT"):
        with pytest.raises(ValueError, match=r"'torque': planner\.effects\.compliance\.\w+ has that key"):
            type("Twice", (basis.BasisFunction,), {}, key=key)
    for own in (False, True):
        with pytest.raises(ValueError, match=r"'backlash': planner\.effects\.backlash has registered it already"):
            registry.register("slack", "backlash", by_gauge=own)(lambda run: iter(()))
    assert before == (basis.FUNCTIONS, registry._REGISTRY)


def test_a_cell_of_a_notebook_that_defines_an_effect_runs_twice(hose):
    """The second definition counts, also for keys that were looked up before; another module is still refused."""
    assert phi_from_key("hose:4", 6)(SimpleSamples(0.5)) == pytest.approx(0.3)
    text = Path(hose.__file__).read_text().replace("SLACK = 0.2", "SLACK = 0.1").replace("JOINT: hose", "JOINT: rope")
    count = len(basis.FUNCTIONS), len(registry._REGISTRY)
    exec(compile(text, hose.__file__, "exec"), hose.__dict__)
    assert (len(basis.FUNCTIONS), len(registry._REGISTRY)) == count
    assert phi_from_key("hose:4", 6)(SimpleSamples(0.5)) == pytest.approx(0.4)
    assert phi_from_key("hose:4", 6).plot_label == "joint JOINT: rope wound up (rad)"
    with pytest.raises(ValueError, match="has that key"):
        exec(text, {"__name__": "elsewhere"})


class SimpleSamples:
    """A context with one sample at which joint 4 stands at an angle [rad]."""

    def __init__(self, angle):
        self.samples = self
        self.q = np.full((1, 6), angle)


@pytest.mark.parametrize(("unit", "said"), [("mm", "'m' would be"), ("rad/Nm^2", "'Nm\\^2' is no unit")])
def test_a_parameter_has_a_unit_of_the_si(unit, said):
    with pytest.raises(ValueError, match=f"'hose'.*{said}"):
        Parameter("hose", unit, 1e-4, "pull of the hose", transform_move(0))


@pytest.mark.parametrize(
    ("unit", "value", "std", "said"),
    [
        ("rad/Nm/Nm", 7.97e-8, 4e-10, "0.07970 ± 0.00040 µrad/Nm/Nm"),
        ("1/m", 2e-7, 3e-8, "0.200 ± 0.030 ppm/m"),
        ("kg/N", 7.97e-11, 4e-13, "7.97e-11 ± 4e-13 kg/N"),
    ],
)
def test_no_size_is_written_as_zeros(unit, value, std, said):
    assert format_value(value, std, *display_unit(unit, value)) == said
