"""What every command gives: a summary, JSON and charts."""

from abc import ABC, abstractmethod
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from planner.common.content_hashes import HandEdit
from planner.common.errors import InputError
from planner.common.files import document_text, write_bytes, write_text
from planner.common.result_folder import draft_folder, move_all
from planner.common.summary import SCREEN_LINES, Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def simulated_section(simulated: bool) -> dict[str, bool]:
    """Return the entry ``simulated`` of a document; empty if the readings were measured."""
    return {"simulated": True} if simulated else {}


PLOT_FORMATS: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    ".svg": {"Date": None, "Creator": None},
}
"""Suffixes of pictures, and what is left out of each: the same plot gives the same bytes."""


@dataclass(frozen=True)
class Plot:
    """A chart as a picture; a notebook shows it.

    Attributes:
        name: of the chart.
        png: the picture for the screen.
        draw: makes the figure of matplotlib.

    Example:
        >>> plot = found.plot_residuals()  # doctest: +SKIP
        >>> plot.axes[0].set_title("Residuals of arm 3")  # doctest: +SKIP
        >>> plot.save("residuals.pdf")  # doctest: +SKIP
    """

    name: str
    png: bytes = field(repr=False)
    draw: "Callable[[], Figure]" = field(repr=False, compare=False)

    def _repr_png_(self) -> bytes:
        return self._picture(".png")

    @cached_property
    def figure(self) -> "Figure":
        """The figure of matplotlib; what is changed in it is saved too."""
        return self.draw()

    @property
    def axes(self) -> "list[Axes]":
        """The axes of the figure, panel by panel."""
        return self.figure.axes

    def save(self, path: Path | str) -> Path:
        """Write the picture to ``path`` as PDF, SVG or PNG, by its suffix.

        Raises:
            InputError: the suffix is another one.
        """
        path = Path(path)
        if path.suffix.lower() not in PLOT_FORMATS:
            raise InputError(f"{path}: a picture is written as {', '.join(PLOT_FORMATS)}: give one of these suffixes")
        write_bytes(path, self._picture(path.suffix.lower()))
        return path

    def _picture(self, suffix: str) -> bytes:
        if suffix == ".png" and "figure" not in self.__dict__:
            return self.png
        import matplotlib  # a command that draws nothing starts quicker without

        out = BytesIO()
        with matplotlib.rc_context({"svg.hashsalt": "edbb", "pdf.fonttype": 42}):  # 42: letters stay letters
            self.figure.savefig(out, format=suffix.removeprefix("."), metadata=PLOT_FORMATS[suffix])
        return out.getvalue()


NOT_MEASURED = "SIMULATED: nobody has measured this robot; nothing here is true of a real one"


class Result(ABC):
    """What a command found; nothing is written before :meth:`write` is called.

    Example:
        >>> found = identify("run.csv", plan="session/plan.json")  # doctest: +SKIP
        >>> print(found.summary(verbose=True))  # doctest: +SKIP
        >>> found.to_json()  # doctest: +SKIP
    """

    cut_short: tuple[str, ...] = ()
    """What a limit left undone."""

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let every kind of result show itself in one line, where it has no words of its own: its arrays are long."""
        super().__init_subclass__(**arguments)
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """Return the kind of result and the first line of its summary."""
        return f"<{type(self).__name__}{' (simulated)' if self.simulated else ''}: {self.overview().title}>"

    @abstractmethod
    def overview(self) -> Summary:
        """Return the findings, one fact a line."""

    def summary(self, verbose: bool = False) -> str:
        """Return the findings in at most eight lines; all of them with ``verbose``."""
        return self.overview().text(verbose, SCREEN_LINES)

    @abstractmethod
    def content(self) -> Mapping[str, Any]:
        """Return the machine-readable form of what was found."""

    @abstractmethod
    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write everything into a folder, or the one file that there is; return the files.

        ``force``: over what somebody else has written too.
        """

    def files(self, folder: Path) -> str:
        """Name the files that a person looks for in the folder once it is written."""
        return ""

    def next_step(self, folder: Path) -> str:
        """Say what a person does next with the folder once it is written; empty where nothing follows."""
        return ""

    @property
    def problems(self) -> tuple[str, ...]:
        """Return why the result must not be used; empty where it may."""
        return ()

    @property
    def is_failed(self) -> bool:
        """Tell whether what was judged did not pass: the command then ends with exit code 3."""
        return False

    @property
    def simulated(self) -> bool:
        """Tell whether it is made of readings that nobody measured."""
        return False

    @property
    def alarm(self) -> str:
        """Return the warning that must be read first; empty if there is none."""
        return ""

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed since edbb wrote it: of a result in a cell, in the files of its robot."""
        cell: Any = getattr(self, "cell", None)
        return () if cell is None else tuple(cell.robot.hand_edits)

    def full_summary(self, verbose: bool = False, most: int = SCREEN_LINES) -> str:
        """Return the summary, after what must be read first; ``most``: lines in all.

        First come what nobody measured, and what was changed by hand.
        """
        said = (self.alarm, NOT_MEASURED if self.simulated else "", *(e.sentence for e in self.hand_edits))
        first = [line for line in said if line]
        return "\n".join((*first, self.overview().text(verbose, most - len(first))))

    def to_json(self) -> str:
        """Return the machine-readable form as text."""
        return document_text(self.content())

    def preview(self) -> Plot | None:
        """Return the chart that a notebook shows below the summary, if there is one."""
        return None

    def _repr_html_(self) -> str:
        plot = self.preview()
        picture = f'<img src="data:image/png;base64,{b64encode(plot.png).decode()}">' if plot else ""
        return f"<pre>{escape(self.full_summary())}</pre>{picture}"


class FolderResult(Result):
    """A result that is a folder: its ``main_file``, which is the content, and what goes with that."""

    main_file: ClassVar[str]

    @abstractmethod
    def fill(self, draft: Path) -> None:
        """Write everything but the main file into an empty folder."""

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write the folder, all of it or nothing; return the files. ``force``: over files of others too.

        Raises:
            InputError: it is a file, or the folder that you are in; or it holds files that are not to be written over.
        """
        folder = Path(folder)
        with draft_folder(folder) as draft:
            write_text(draft / self.main_file, self.to_json())
            self.fill(draft)
            return move_all(draft, folder, force)
