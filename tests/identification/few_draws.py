"""A released robot from a sixth of the draws, where it is written, shown or driven, and not held against the truth."""

from contextlib import contextmanager

import pytest

import planner.inference.misfit as misfit
import planner.inference.posterior_draws as posterior_draws
import planner.release.releasing as release


@contextmanager
def few_draws():
    """Draw the sizes in 40 sweeps in place of 160; a decorator as well."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior_draws, "SWEEPS", 40)
        for room in (misfit, release):
            patch.setattr(room, "SWEEPS", 12)
        yield
