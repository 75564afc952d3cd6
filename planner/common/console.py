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


def spell_unencodable() -> None:
    """Let standard output and errors spell plainly what their encoding lacks, where it is not UTF-8."""
    codecs.register_error(NAME, spell_plainly)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and codecs.lookup(stream.encoding).name != "utf-8":
            stream.reconfigure(errors=NAME)


def as_word(path: Path | str) -> str:
    """Return a path as one word of a command that a person may copy: quoted where a shell would part or change it."""
    return subprocess.list2cmdline([str(path)]) if os.name == "nt" else shlex.quote(str(path))
