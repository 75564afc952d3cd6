"""Text for a console: plain letters where it lacks some, and paths that its shell takes as one word."""

import codecs
import os
import shlex
import subprocess
import sys
from io import TextIOWrapper
from pathlib import Path

PLAIN = {
    "µ": "u", "μ": "u", "σ": "sigma", "φ": "phi", "θ": "theta", "Δ": "d", "Σ": "sum", "√": "sqrt",
    "→": "->", "─": "-", "►": ">", "◄": "<", "│": "|", "━": "-", "•": "*", "·": "*", "×": "x", "±": "+-",
    "≤": "<=", "≥": ">=", "≈": "~", "−": "-", "–": "-", "—": "-", "…": "...", "°": " deg", "²": "2", "³": "3",
    "’": "'", "“": '"', "”": '"', "é": "e", "ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss",
}  # fmt: skip
"""What stands for a sign that a console lacks; any other sign is a question mark."""
NAME = "edbb-plain"


def spell_plainly(err: UnicodeError) -> tuple[str, int]:
    """Return plain letters for what could not be encoded, as the codecs of Python ask for them."""
    if not isinstance(err, UnicodeEncodeError):
        raise err
    return "".join(PLAIN.get(letter, "?") for letter in err.object[err.start : err.end]), err.end


def encode_output() -> None:
    """Let standard output and errors be UTF-8 in a file or a pipe, unless PYTHONIOENCODING says otherwise.

    What a screen, or that other encoding, lacks is spelt plainly.
    """
    codecs.register_error(NAME, spell_plainly)
    for stream in (sys.stdout, sys.stderr):
        if not isinstance(stream, TextIOWrapper):
            continue
        if "PYTHONIOENCODING" not in os.environ and not _is_screen(stream):
            stream.reconfigure(encoding="utf-8", errors=stream.errors)
        elif codecs.lookup(stream.encoding).name != "utf-8":
            stream.reconfigure(errors=NAME)


def _is_screen(stream: TextIOWrapper) -> bool:
    try:
        return os.isatty(stream.fileno())
    except (OSError, ValueError):  # it has no file, or is closed
        return False


def as_word(path: Path | str) -> str:
    """Return a path as one word of a command that a person may copy: quoted where a shell would part or change it."""
    return subprocess.list2cmdline([str(path)]) if os.name == "nt" else shlex.quote(str(path))
