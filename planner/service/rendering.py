"""Templates of the pages, and what each page shows of who looks at it."""

from contextvars import ContextVar
from pathlib import Path

from fastapi.responses import HTMLResponse

from planner import __version__
from planner.report.page import template_environment
from planner.service.callers import CALLER

FOLDER = Path(__file__).parent
STATIC = FOLDER / "static"
ENVIRONMENT = template_environment(FOLDER / "templates")
ENVIRONMENT.globals["version"] = __version__


ROOT: ContextVar[str] = ContextVar("root", default="")
"""Where the service lies on its host: empty, or a path such as ``/edbb``."""


def render(template: str, status: int = 200, /, **content: object) -> HTMLResponse:
    """Return a page."""
    page = ENVIRONMENT.get_template(f"{template}.html.j2")
    return HTMLResponse(page.render(status=status, caller=CALLER.get(), root=ROOT.get(), **content), status)
