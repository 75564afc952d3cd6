"""Files that a template may read: those in the robot's folder and in packages that the user has named."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

from planner.common.errors import InputError
from planner.common.files import MOST_TOML, read_bytes
from planner.common.xml_files import XmlError, parse_xml
from planner.kinematics.packages import Packages
from planner.kinematics.xacro.values import XacroError, check_value

UNITS = {  # of a number in a YAML file: [rad] or [m]
    "!radians": 1.0,
    "!degrees": 0.017453292519943295,
    "!meters": 1.0,
    "!millimeters": 1e-3,
    "!foot": 0.3048,
    "!inches": 0.0254,
}


class TemplateFiles:
    """The files of one template, each read once.

    Args:
        path: the template itself.
        packages: where ``$(find …)`` and ``package://`` lead.
        spend: told the bytes that are read.
    """

    def __init__(self, path: Path, packages: Packages, spend: Callable[[int], None]) -> None:
        self._spend, self._packages = spend, packages
        self._roots = tuple(dict.fromkeys([path.resolve().parent, *(p.resolve() for p in packages.folders.values())]))
        self._documents: dict[Path, ET.Element] = {}
        self._tables: dict[Path, object] = {}

    def find(self, name: str, beside: Path) -> Path:
        """Return the file that a template names, which a link may not lead out of the folders that it may read.

        Raises:
            XacroError: it lies elsewhere.
        """
        if name.startswith("package://"):
            package, _, rest = name.removeprefix("package://").partition("/")
            name = str(self._packages.find(package) / rest)
        try:
            path = (beside / name.removeprefix("file://")).resolve()
        except (OSError, ValueError, RuntimeError) as err:
            raise XacroError(f"'{name[:100]}' is no name of a file") from err
        if not any(path.is_relative_to(root) for root in self._roots):
            folders = ", ".join(map(str, self._roots))
            raise XacroError(
                f"'{name[:200]}' lies outside the folders that this template may read ({folders}). Name the package "
                "that holds it by --package NAME=DIR, or in the table [packages] of robot.toml or cell.toml"
            )
        return path

    def document(self, path: Path) -> ET.Element:
        """Return the root of an XML file; nobody changes it.

        Raises:
            InputError: it cannot be read.
        """
        if path not in self._documents:
            data = read_bytes(path, MOST_TOML)
            self._spend(len(data))
            try:
                self._documents[path] = parse_xml(data)
            except XmlError as err:
                raise InputError(f"{path}: cannot be read as XML ({err})") from err
        return self._documents[path]

    def table(self, path: Path, number: Callable[[str], object]) -> object:
        """Return what a YAML file holds: texts, numbers, lists and tables; ``number``: evaluates one with a unit.

        Raises:
            InputError: it cannot be read.
        """
        if path not in self._tables:
            # 200_000: bytes: the reader takes seconds for more, and tables of robots have a tenth of it
            data = read_bytes(path, 200_000)
            self._spend(2 * len(data))
            self._tables[path] = read_yaml(path, data, number)
        return self._tables[path]


def read_yaml(path: Path, data: bytes, number: Callable[[str], object]) -> object:
    """Return plain values of a YAML text; ``number`` reads those with a unit as their tag.

    Raises:
        InputError: it is none, or the package that reads it is not installed.
    """
    try:
        import yaml
    except ImportError as err:
        raise InputError(
            f"{path}: is YAML, and the package that reads it is not installed: pip install pyyaml"
        ) from err

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        """Plain values alone; entries that merge others could grow without end."""

        def flatten_mapping(self, node: Any) -> None:
            """Refuse what another table is merged into."""
            if any(key.tag == "tag:yaml.org,2002:merge" for key, _ in node.value):
                raise XacroError("a table that merges another (<<) is not read; write out its entries")

    def with_unit(loader: Any, node: Any) -> float:
        """Return the number times the unit that its tag names."""
        value = number(str(loader.construct_scalar(node)))
        if not isinstance(value, int | float):
            raise XacroError(f"'{value}' with the unit {node.tag} is no number")
        return float(value) * UNITS[node.tag]

    for tag in UNITS:
        Loader.add_constructor(tag, with_unit)
    try:
        return _copy_plain(yaml.load(data, Loader), {}, ())
    except (yaml.YAMLError, XacroError, ValueError, ArithmeticError, TypeError, RecursionError) as err:
        raise InputError(f"{path}: cannot be read as YAML ({err})") from err


def _copy_plain(value: object, done: dict[int, object], above: tuple[int, ...]) -> object:
    """Return a value of plain ones; what stands at several places is one object there too."""
    if not isinstance(value, dict | list):
        return check_value(value)
    key = id(value)
    if key in above:
        raise XacroError("a table holds itself")
    if key not in done:
        inside = (*above, key)
        if isinstance(value, list):
            done[key] = [_copy_plain(v, done, inside) for v in value]
        else:
            done[key] = {check_value(k): _copy_plain(v, done, inside) for k, v in value.items()}
    return done[key]
