"""What the next steps of a calibration promise."""

from types import SimpleNamespace

import pytest

from planner.documents.calibration_summary import _next_steps
from planner.model.identification_document import ErrorParts


@pytest.mark.parametrize(("measured", "left"), [(0.25e-3, "0.25 mm"), (None, "0.000 mm")])
def test_no_step_promises_less_than_the_error_at_poses_like_those_measured(measured, left):
    """Where one part is the whole error, nothing would be left without it."""
    whole = 1.27e-3  # [m]
    parts = ErrorParts(seen=0.0, unseen=0.0, misfit=0.0, drift=whole)
    release = SimpleNamespace(other_tool=whole, work_tool=None, parts=parts, misfit_place=None, where_measured=measured)
    run = SimpleNamespace(readings=SimpleNamespace(length=None), places=())
    found = SimpleNamespace(workspace_error=whole, more=None, run=run, n_groups=60, good_for=None, reason_not_to_use="")
    warm, _ = _next_steps(found, release, "measured", None)
    assert warm.what.startswith("Measure once the arm is warm")
    assert warm.brings == f"1.27 → {left} rms at best"
