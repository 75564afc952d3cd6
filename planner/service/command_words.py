"""Whether a word of a command line may name something outside the folder that it runs in."""

import re

from planner.common.errors import InputError


class RefusedCommandError(InputError):
    """A command that a service does not run."""


# A slash is harmless between names (out/run.csv, ur10/edbb), and nowhere else: not at the start of a word (/etc), after
# a sign (--cell=/etc, a,/etc), nor in a word that glues a value to a short option (-o/etc, -fo/etc).
OUTSIDE = re.compile(r"\.\.|(?<![A-Za-z0-9_.+-])/|^-[^-/]*/")


def leads_outside(word: str) -> bool:
    """Tell whether a word can name a path that leads out of the folder of its command."""
    return OUTSIDE.search(word) is not None


FOLDERS = re.compile(r"(?<![\w./:<])/(?!api/)(?:[^\s/:'\"]+/)+")
"""The folders of a path from the root of a disk; addresses of the interface are none."""


def hide_folders(text: str) -> str:
    """Return a message without the folders of this machine: whoever asks is told names of files alone."""
    return FOLDERS.sub("", text)
