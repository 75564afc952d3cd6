"""The robot's own side of a centring, from the dialect's folder: ``g-code/krl/centring.src.j2`` and ``.dat.j2``."""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from planner.centring.settings import RobotFile
from planner.errors import InputError
from planner.files import write_text
from planner.resources import folder
from planner.units import MM

DIALECT = "krl"
LARGEST_MM = 5.0  # the robot takes no longer shift, whatever the planner says


def centring_program(how: RobotFile) -> dict[str, str]:
    """Return the files of the robot's program, by name; lines end as the controller wants them."""
    environment = Environment(
        loader=FileSystemLoader(folder("g-code") / DIALECT),
        undefined=StrictUndefined,
        trim_blocks=True,
        autoescape=False,  # a robot program is no HTML
    )
    context = {
        "name": how.program,
        "tool": how.tool,
        "base": how.base,
        "speed_m_s": how.speed_mm_s * MM,
        "silence_ms": round(1e3 * how.silence_s),
        "timer": how.timer,
        "largest_mm": LARGEST_MM,
    }
    texts = {e: environment.get_template(f"centring.{e}.j2").render(context) for e in ("src", "dat")}
    return {f"{how.program}.{e}": "\r\n".join(text.splitlines()) + "\r\n" for e, text in texts.items()}


def write_centring_program(how: RobotFile, out: Path) -> list[Path]:
    """Write the robot's program into a folder, and return its files.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise InputError(f"{out}: cannot be made ({err.strerror or err})") from err
    paths = []
    for name, text in centring_program(how).items():
        write_text(out / name, text, "ascii")
        paths.append(out / name)
    return paths
