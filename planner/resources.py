"""The one place that finds the data folders ``robots`` and ``g-code``, in a wheel and in a checkout."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """Return the packaged data folder ``name`` if it is there, else the checkout's.

    Raises:
        FileNotFoundError: the installation holds neither.
    """
    for candidate in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the data folder '{name}' is missing from this installation")
