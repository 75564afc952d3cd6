"""Makes every picture of the pages from real output: ``python -m docs.make_pictures [--all] [NAME ...]``.

A picture knows the files that decide what it shows. ``pictures.json`` keeps their hashes; a picture whose files have
changed is stale, which ``tests/docs/test_pictures.py`` says, and is made anew here.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
INDEX = PICTURES / "pictures.json"
DRAWING = "docs/drawing"


@dataclass(frozen=True)
class Picture:
    """A file under ``docs/pictures``, what draws it, and the files (from the root) that decide what it shows."""

    name: str
    draw: Callable[[], bytes]
    shows: tuple[str, ...]

    @property
    def path(self) -> Path:
        """Where it lies."""
        return PICTURES / self.name

    def state(self) -> dict[str, str]:
        """Return the hashes of what it shows and of the picture itself."""
        return {name: digest(ROOT / name) for name in (*self.shows, f"docs/pictures/{self.name}")}


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, of text without its line ends; nothing where it is not there."""
    if not path.is_file():
        return ""
    return hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()


def pictures() -> Iterator[Picture]:
    """Yield every picture; drawing libraries are loaded only as one is drawn."""
    for cell in sorted(ROOT.glob("robots/*/cells/*.toml")):
        robot = cell.parents[1]
        files = sorted(f for f in robot.iterdir() if f.suffix in (".toml", ".urdf"))
        shows = tuple(f.relative_to(ROOT).as_posix() for f in (cell, *files))
        yield Picture(f"cell_{robot.name}_{cell.stem}.png", partial(_cell, cell), (*shows, f"{DRAWING}/cells.py"))
    arm = "robots/kuka-kr6-r700/robot.toml"
    yield Picture("kuka-kr6-r700.svg", partial(_arm, arm), (arm, "planner/report/robot_drawing.py"))
    plans = {
        "kuka-bar": ("tests/data/kr6-plan/plan.json", "tests/data/kr6-plan/cell.toml"),
        "panda-tracker": ("docs/pictures/plans/panda-tracker.json", "docs/pictures/plans/panda-tracker.toml"),
        "so101-sockets": ("docs/pictures/plans/so101-sockets.json", "docs/pictures/plans/so101-sockets.toml"),
    }
    for name, files in plans.items():
        yield Picture(f"film_{name}.gif", partial(_film, *files), (*files, f"{DRAWING}/cells.py"))
        yield Picture(f"plan_{name}.png", partial(_chart, "plan_charts", ROOT / files[0]), _of_charts(files[0]))
    yield Picture("ur5_before_after.png", partial(_chart, "ur5_before_after"), _of_run("ur5"))
    yield Picture("panda_before_after.png", partial(_chart, "panda_before_after"), _of_run("panda"))
    measured = ("docs/pictures/shown/stopping.json", f"{DRAWING}/stopping.py")
    yield Picture("stopping.png", partial(_stopping, "0.2"), measured)
    numbers = ("planner/reproduction/numbers.json", "planner/reproduction/pictures.py")
    for name in ("pruning", "tour", "circle_and_path", "sine", "accuracy"):
        yield Picture(f"papers_{name}.png", partial(_of_papers, name), numbers)
    pages = ("planner/service/templates/base.html.j2", f"{DRAWING}/pages.py")
    yield Picture("page_start.png", partial(_page, "start_page"), ("planner/service/templates/start.html.j2", *pages))
    shown = ("planner/service/templates/calibrate.html.j2", "planner/service/static/calibrate.js", *pages)
    yield Picture("page_calibrate.png", partial(_page, "calibrate_page", ROOT / plans["kuka-bar"][0]), shown)
    for run, title in TITLES.items():
        yield Picture(f"{run}_stages.png", partial(_chart, "stages", run, title), _of_run(run))


TITLES = {
    "ur5": "UR5 and tracker: stages of the fit (number of parameters)",
    "ur10": "UR10 and tracker: stages of the fit (number of parameters)",
    "panda": "Panda and plate: stages of the fit (number of parameters)",
}
# what decides the figures of a public run, beside the program, which tests/identification/test_real.py watches
RUNS = {
    "ur5": ("tests/data/ur5-tracker/run.csv", "tests/data/ur5-tracker/validation.csv",
            "tests/identification/cells/ur5-tracker.toml", "tests/identification/cells/ur5.toml"),
    "ur10": ("tests/data/ur10-tracker/run.csv", "tests/identification/cells/ur10-tracker.toml",
             "robots/ur10/robot.toml"),
    "panda": ("tests/data/panda-ball/front_center.csv", "tests/data/panda-ball/panda.urdf"),
}  # fmt: skip


def _of_charts(*files: str) -> tuple[str, ...]:
    return (*files, f"{DRAWING}/charts.py")


def _of_run(run: str) -> tuple[str, ...]:
    return _of_charts(*RUNS[run], f"docs/pictures/shown/{run}.json")


def _arm(robot: str) -> bytes:
    from planner.kinematics.robot_reader import load_robot
    from planner.report.robot_drawing import draw_robot

    return draw_robot(load_robot(ROOT / robot)).encode()


def _cell(path: Path) -> bytes:
    from docs.drawing.cells import cell_picture

    return cell_picture(path)


def _film(plan: str, cell: str) -> bytes:
    from docs.drawing.cells import session_film

    return session_film(ROOT / plan, ROOT / cell)


def _chart(function: str, *arguments: object) -> bytes:
    import docs.drawing.charts as charts

    drawn: bytes = getattr(charts, function)(*arguments)
    return drawn


def _stopping(goal: str) -> bytes:
    from docs.drawing.stopping import stopping_curves

    return stopping_curves(goal)


def _page(function: str, *arguments: object) -> bytes:
    import docs.drawing.pages as pages

    shown: bytes = getattr(pages, function)(*arguments)
    return shown


def _of_papers(name: str) -> bytes:
    from planner.reproduction.pictures import draw_picture
    from planner.reproduction.rows import stored_numbers

    return draw_picture(name, stored_numbers())


def measure(run: str) -> None:
    """Fit a public run again and keep its figures: of its stages, and of the robot that is written."""
    import docs.drawing.real_runs as real_runs

    released = PICTURES / "shown" / "released.json"
    all_runs = json.loads(released.read_text(encoding="utf-8"))
    _keep(PICTURES / "shown" / f"{run}.json", getattr(real_runs, f"measure_{run}")())
    figures = getattr(real_runs, f"released_{run}")()
    _keep(released, all_runs | {run: {name: float(real_runs.on_page(value)) for name, value in figures.items()}})


def _keep(file: Path, figures: dict[str, object]) -> None:
    file.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def known() -> dict[str, dict[str, str]]:
    """Return the hashes at which each picture was made."""
    read: dict[str, dict[str, str]] = json.loads(INDEX.read_text(encoding="utf-8")) if INDEX.is_file() else {}
    return read


def stale() -> list[str]:
    """Return the names of the pictures that are older than what they show, or are not there."""
    made = known()
    return [p.name for p in pictures() if made.get(p.name) != p.state() or not p.path.is_file()]


def main() -> None:
    """Make what is stale, what is named, or everything."""
    parser = argparse.ArgumentParser(prog="python -m docs.make_pictures")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--measure", nargs="*", default=[], choices=RUNS, help="fit these public runs again first")
    asked = parser.parse_args()
    for run in asked.measure:
        measure(run)
    wanted = set(asked.names or ([p.name for p in pictures()] if asked.all else stale()))
    made = {p.name: known().get(p.name, {}) for p in pictures()}
    for picture in pictures():
        if picture.name in wanted:
            picture.path.write_bytes(picture.draw())
            made[picture.name] = picture.state()
            print(picture.name, picture.path.stat().st_size, file=sys.stderr, flush=True)
            INDEX.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
