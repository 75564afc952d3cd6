"""Whose axes the joint angles of a file are: of its language's controller, or of a table as its head says."""

from dataclasses import dataclass

from planner.common.errors import InputError
from planner.common.units import Array
from planner.compensation.correction import FlangeModel
from planner.compensation.languages import TABLE
from planner.compensation.targets import Note
from planner.kinematics.axes import MODEL, AxisConvention
from planner.kinematics.axes_line import KEY, axes_lines
from planner.kinematics.robot import Robot
from planner.programs.controller_axes import controller_words, log_axes
from planner.programs.dialect import load_dialect
from planner.programs.rendering import axis_names

SLOWLY = "drive it slowly the first time"


def axes_of_file(name: str, language: str, text: str, robot: Robot, option: str | None) -> AxisConvention:
    """Return how the joint angles of a file count.

    Args:
        name: of the file, for messages.
        language: name of its dialect, or ``csv`` for a table.
        text: its content.
        robot: the nominal robot, whose file says how controllers count.
        option: the controller that the person has named, of a table.

    Raises:
        InputError: a controller that the robot's file says nothing of; or table and person name two.
    """
    if language != TABLE:
        if option is not None:
            raise InputError(
                f"{name}: --axes-of is for tables; the angles of a program are those of its own controller ({language})"
            )
        return log_axes(robot, language)
    said = axes_lines(name, text.splitlines()) | (set() if option is None else {option})
    if len(said) > 1:
        raise InputError(f"{name}: the angles are said to be of {' and of '.join(sorted(said))}; name one")
    return log_axes(robot, next(iter(said), MODEL))


def axes_notes(language: str, robot: Robot, axes: AxisConvention) -> list[Note]:
    """Return notes about the angles of a file for the person who uses it."""
    if not axes.is_same:
        names = axis_names(load_dialect(axes.controller))
        return [(1, f"joint angles are those of {axes.controller}: {', '.join(axes.sentences(names))}")]
    others = [c.controller for c in robot.conventions if not c.is_same]
    if language == TABLE and axes.controller == MODEL and others:
        said = f"a line '# {KEY}: {others[0]}' says it"
        return [(1, f"joint angles are taken for the model's; where they are a controller's, {said}")]
    return []


def axes_statement(name: str, language: str, text: str, axes: AxisConvention) -> list[str]:
    """Return the remark by which a corrected table says whose axes its angles are; none where it says so itself."""
    return [f"{KEY}: {axes.controller}"] if language == TABLE and not axes_lines(name, text.splitlines()) else []


def next_step(language: str, robot: Robot, axes: AxisConvention) -> str:
    """Return what a person does next with the corrected ``{file}``, and for which controller its angles are."""
    if language != TABLE:
        return f"load {{file}} into the controller and {SLOWLY}"
    if axes.controller != MODEL:
        words = controller_words(axes.controller)
        return f"{{file}} has the angles of the axes of {words}: load it into that controller and {SLOWLY}"
    own = sorted((c for c in robot.conventions if not c.is_same), key=lambda c: c.controller != robot.dialect)
    if not own:
        return f"{{file}} has the angles of the model's joints{_who_counts_so(robot)} and {SLOWLY}"
    others = ", ".join(
        f"{controller_words(c.controller)} counts {len(c.different_axes)} of {c.n_axes} axes otherwise" for c in own
    )
    return (
        f"{{file}} has the angles of the model's joints; {others}: a table of the angles of that controller is "
        f"corrected with --axes-of {own[0].controller}"
    )


def _who_counts_so(robot: Robot) -> str:
    """Say for which controller the model's angles are, as far as the robot's file says it of any, and what to do."""
    known = sorted((c.controller for c in robot.conventions), key=lambda c: c != robot.dialect)
    if known:
        return f", as {controller_words(known[0])} counts them: load it into that controller"
    return (
        "; robot.toml says of no controller how it counts its axes ([controllers], docs/how-to/robot.md): compare each "
        "axis with the pendant before you load it,"
    )


@dataclass(frozen=True)
class FlangeInAxes:
    """A robot whose angles are those of a controller."""

    model: FlangeModel
    axes: AxisConvention

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at the controller's angles q (n, N) [rad], all effects included."""
        return self.model.flange(self.axes.to_model(q))
