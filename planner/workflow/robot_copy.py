"""A robot's files as a start for one's own: of a shipped robot with its cells, or of a table of DH rows."""

import re
from pathlib import Path

import tomli_w

from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder, read_utf8, write_together
from planner.kinematics.axes import advice
from planner.kinematics.robot_reader import describe_robot, list_robots

ROBOT_FILE = "robot.toml"
CHANGED_HEAD = """\
# Copied from the shipped robot {name}, to be changed into yours: name, title, and from the data sheet a_mm, d_mm,
# limit_deg, speed_deg_s. All sources say that they are of a copy: write there where your numbers come from.
# How the controller counts its axes ([controllers.*]) is copied too: check it at the robot (docs/how-to/robot.md).
# Where a length changes, the bodies of that link change with it: the collision check knows the arm by them alone.

"""
UNKNOWN_MAKER = "krl"  # the language whose axes are shown as an example


def copy_robot(reference: str, folder: Path, force: bool = False) -> list[Path]:
    """Write a robot's ``robot.toml`` and the cells that come with it into a folder, and return the files.

    Args:
        reference: name of a shipped robot, or the path of a CSV table of DH rows.
        folder: where to; the cells name the copied robot.
        force: write over files that are there.

    Raises:
        InputError: no such robot, or files are there that are not to be written over.
    """
    texts = _table_files(Path(reference)) if reference.lower().endswith(".csv") else _shipped_files(reference)
    changed = [n for n, text in texts.items() if (folder / n).is_file() and (folder / n).read_bytes() != text.encode()]
    if changed and not force:
        raise InputError(
            f"{folder / changed[0]}: is there already and says otherwise; name another folder, or add --force"
        )
    folder.mkdir(parents=True, exist_ok=True)
    write_together([(folder / name, text.encode()) for name, text in texts.items()], force=force)
    return [folder / name for name in texts]


def _shipped_files(name: str) -> dict[str, str]:
    """Return the files of a shipped robot by name; its cells name the file beside them."""
    known = list(list_robots())
    if name not in known:
        raise InputError(
            f"robot '{name}': neither a shipped robot nor a table of DH rows (.csv){did_you_mean(name, known)} "
            f"(shipped: {', '.join(known)})"
        )
    shipped = data_folder("robots") / name
    cells = {p.name: read_utf8(p) for p in sorted((shipped / "cells").glob("*.toml"))}
    named = re.compile(rf'^robot = "{re.escape(name)}"', re.MULTILINE)
    return {
        ROBOT_FILE: CHANGED_HEAD.format(name=name) + _with_sources_of_copy(read_utf8(shipped / ROBOT_FILE), name),
        **{cell: named.sub(f'robot = "{ROBOT_FILE}"', text) for cell, text in cells.items()},
    }


def _with_sources_of_copy(text: str, name: str) -> str:
    """Return a ``robot.toml`` whose sources all say that they are a copy's: programs and documents cite them.

    A person who changes rows and forgets the sources would else have another arm's data sheet vouch for them.
    """
    copied = f"copied from {name}, renew: "
    head, mark, rest = text.partition("\n[sources]\n")
    topics, bracket, tables = rest.partition("\n[")
    topics = re.sub(r'^(\w+ = ")', rf"\g<1>{copied}", topics, flags=re.MULTILINE)
    tables = re.sub(r'^(source = ")', rf"\g<1>{copied}", tables, flags=re.MULTILINE)
    return head + mark + topics + bracket + tables


def _table_files(path: Path) -> dict[str, str]:
    """Return the ``robot.toml`` of a table of DH rows, with what such a table has no room for, to be filled in."""
    described = describe_robot(path)
    content = described.model_dump(mode="json", by_alias=True, exclude_unset=True)
    remarks = [
        f"# From {path.name}. Add what a table of rows has no room for:",
        "# bodies of the links, or the arm itself is in no collision check: [[bodies]] as in a shipped robot",
        "# (edbb robots NAME -o FOLDER shows one); and how the controller counts its axes (docs/how-to/robot.md):",
        *(f"# {line.strip()}" for line in advice(UNKNOWN_MAKER, len(described.joints)).splitlines()),
    ]
    return {ROBOT_FILE: "\n".join(remarks) + "\n\n" + tomli_w.dumps(content)}
