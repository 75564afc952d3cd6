"""``fleet.toml``: how large the errors of robots of one kind are, as several of them have shown; prior of the next."""

from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import Field

from planner.cell.site import Site
from planner.common.content_hashes import hand_edits
from planner.common.errors import InputError
from planner.common.schema import PositiveFloat, StrictModel, read_toml, read_toml_content

S = TypeVar("S", bound=Site)


class FleetSize(StrictModel):
    """How large errors of a group are: times what is usual, one standard deviation of its logarithm, errors seen."""

    group: str
    factor: PositiveFloat
    log_std: PositiveFloat
    seen: float = Field(ge=0)


class FleetFile(StrictModel):
    """The file; ``robot``: the kind, ``robots``: how many were seen, ``hashes``: of its keys, as it was written."""

    schema_: Literal["edbb-fleet/1"] = Field(alias="schema")
    robot: str
    robots: int = Field(ge=2)
    sizes: tuple[FleetSize, ...]
    hashes: dict[str, str] = {}


def read_fleet(path: Path, robot: str) -> FleetFile:
    """Read what a fleet of a kind of robot has shown.

    Raises:
        InputError: no such file, or it is of another kind.
    """
    file = read_toml(path, FleetFile)
    if file.robot != robot:
        raise InputError(f"{path}: is of the robot '{file.robot}', but the cell's is '{robot}'")
    return file


def with_fleet(site: S, path: Path | str | None) -> S:
    """Return a cell whose robot's errors are as large as a fleet of its kind has shown; as it is without a file.

    Raises:
        InputError: as of :func:`read_fleet`.
    """
    if path is None:
        return site
    file = read_fleet(Path(path), site.robot.name)
    factors = tuple((size.group, size.factor) for size in file.sizes)
    edits = (*site.robot.hand_edits, *hand_edits(Path(path), read_toml_content(Path(path))))
    robot = replace(site.robot, priors=replace(site.robot.priors, factors=factors), hand_edits=edits)
    return replace(site, robot=robot)
