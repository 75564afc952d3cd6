"""Plans whose search for the poses is short: what is asserted of them holds whatever the search has found."""

from contextlib import contextmanager
from functools import partial

import pytest

import planner.design.pose_selection as pose_selection
from planner.design.selection.index_search import exchange_poses


@contextmanager
def quick_search():
    """Search in a twelfth of the steps, and show two numbers of poses of the curve."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pose_selection, "SHOWN_SIZES", (28, 60))
        patch.setattr(pose_selection, "exchange_poses", partial(exchange_poses, steps=1000))
        yield
