"""Wine with the unzipped folder, once for all tests here. ``EDBB_WINE`` names a folder in which it stays."""

import os
from pathlib import Path

import pytest

from tests.windows.wine import Wine, build_folder, require_wine


@pytest.fixture(scope="session")
def wine(tmp_path_factory):
    """The program for Windows, unzipped; skips where there is no Wine."""
    require_wine()
    kept = os.environ.get("EDBB_WINE")
    folder = Path(kept) if kept else tmp_path_factory.mktemp("wine")
    folder.mkdir(exist_ok=True)
    made = Wine(folder, next(folder.glob("edbb-*-windows.zip"), None) or build_folder(folder))
    yield made
    made.stop()
