"""A released robot from a fifth of the draws, where it is written, shown or driven, and not held against the truth."""

from contextlib import contextmanager

import pytest

import planner.identification.misfit as misfit
import planner.identification.posterior_draws as posterior_draws


@contextmanager
def few_draws():
    """Draw the sizes in 12 sweeps in place of 60; a decorator as well."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior_draws, "SWEEPS", 12)
        patch.setattr(posterior_draws, "BURN_IN", 3)
        patch.setattr(misfit, "SWEEPS", 6)
        yield
