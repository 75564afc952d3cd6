"""Where packages of ROS lie: a user names their folders; nothing is searched for, so ROS need not be installed."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import INPUTS

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,99}")


@dataclass(frozen=True)
class Packages:
    """Folders of packages by name, as ``--package NAME=DIR`` and the table ``[packages]`` of a file name them."""

    folders: Mapping[str, Path] = field(default_factory=dict)

    def __or__(self, other: "Packages") -> "Packages":
        """Return both; where they differ, ``other`` holds."""
        return Packages({**self.folders, **other.folders})

    def find(self, name: str) -> Path:
        """Return the folder of a package.

        Raises:
            InputError: nobody has named it; with the line to add.
        """
        if name not in self.folders:
            raise InputError(f"the package '{name}' is asked for, and nobody has said where it is: {how_to_name(name)}")
        return self.folders[name]


NO_PACKAGES = Packages()


def how_to_name(name: str) -> str:
    """Return the option or line that a person adds so that a package is found."""
    return f'add --package {name}=DIR, or to robot.toml or cell.toml the lines [packages] and {name} = "DIR"'


def named_packages(where: str, table: Mapping[str, str], beside: Path) -> Packages:
    """Return the packages of a table of names and folders, which are relative to the folder ``beside``.

    Raises:
        InputError: a name that no package can have, or no such folder; ``where`` is named.
    """
    return Packages({name: _folder(where, name, beside / text) for name, text in table.items()})


def _folder(where: str, name: str, folder: Path) -> Path:
    if not NAME.fullmatch(name):
        raise InputError(f"{where}: packages: '{name}' is no name of a package (letters, digits, _ and -)")
    try:
        if not INPUTS.allows(folder):
            raise InputError(f"{where}: packages: {name} = '{folder}' lies outside the folder of this job")
        found = folder.is_dir()
    except (OSError, ValueError, RuntimeError):
        found = False
    if not found:
        raise InputError(f"{where}: packages: {name} = '{folder}' is no folder")
    return folder.resolve()


class CommandPackages:
    """What ``--package`` of the present command names; it goes before what files name."""

    def __init__(self) -> None:
        self.packages = Packages()

    def set(self, words: Iterable[str]) -> None:
        """Take the words ``NAME=DIR`` of the command line.

        Raises:
            InputError: a word is none of that form, or names no folder.
        """
        table: dict[str, str] = {}
        for word in words:
            name, equals, folder = word.partition("=")
            if not (name and equals and folder):
                raise InputError(f"--package '{word}': NAME=DIR is needed, such as ur_description=../ur_description")
            table[name] = folder
        self.packages = named_packages("--package", table, Path())


COMMAND_PACKAGES = CommandPackages()
