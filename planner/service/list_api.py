"""Routes of what is there: robots, dialects, and the service itself."""

from functools import cache

from fastapi import APIRouter
from starlette.exceptions import HTTPException

from planner import __version__, load_robot
from planner.cell.reading import shipped_cells
from planner.kinematics.robot_reader import list_robots
from planner.programs.dialect import dialects
from planner.service.answers import DialectEntry, Health, RobotEntry
from planner.service.context import Context
from planner.service.problems import Problem

LISTS = APIRouter(prefix="/api", tags=["lists"])


@LISTS.get("/health")
def get_health(context: Context) -> Health:
    """Tell that the service is there, and how much it has to do."""
    running, waiting = context.jobs.count("running"), context.jobs.count("queued")
    return Health(version=__version__, jobs_running=running, jobs_waiting=waiting)


@LISTS.get("/robots")
def get_robots() -> list[RobotEntry]:
    """List the robots that come with the planner, and their cells."""
    return list(robot_entries())


@LISTS.get("/robots/{name}", responses={404: {"model": Problem}})
def get_robot(name: str) -> RobotEntry:
    """Get one robot."""
    found = next((r for r in robot_entries() if r.name == name), None)
    if found is None:
        raise HTTPException(
            404, f"there is no robot of that name (there: {', '.join(r.name for r in robot_entries())})"
        )
    return found


@LISTS.get("/dialects")
def get_dialects() -> list[DialectEntry]:
    """List the robot languages that programs can be written in."""
    return list(dialect_entries())


@cache
def robot_entries() -> tuple[RobotEntry, ...]:
    """Return the robots that come with the planner."""
    cells, out = shipped_cells(), []
    for name in list_robots():
        r = load_robot(name)
        own = [c for c in cells if c.startswith(f"{name}/")]
        out.append(RobotEntry(name=name, title=r.title, joints=r.n_joints, payload_kg=r.payload, cells=own))
    return tuple(out)


def robot_title(name: str) -> str:
    """Return the title of a robot that comes with the planner; of another one its name."""
    return next((r.title for r in robot_entries() if r.name == name and r.title), name)


@cache
def dialect_entries() -> tuple[DialectEntry, ...]:
    """Return the robot languages."""
    return tuple(
        DialectEntry(name=d.name, title=d.title, units=str(d.units), max_joints=d.max_joints) for d in dialects()
    )
