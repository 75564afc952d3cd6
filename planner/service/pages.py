"""The pages for the person at the cell: rendered here, brought to life by small scripts that come with the package."""

import hmac
from pathlib import Path
from typing import Annotated

import jinja2
from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from planner import __version__
from planner.service.context import Context
from planner.service.guards import COOKIE, is_secure, session_cookie
from planner.service.list_api import dialect_entries, robot_entries

FOLDER = Path(__file__).parent
STATIC = FOLDER / "static"
PAGES = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(FOLDER / "templates"),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.globals["version"] = __version__


def render(template: str, status: int = 200, **content: object) -> HTMLResponse:
    """Return a page."""
    return HTMLResponse(ENVIRONMENT.get_template(f"{template}.html.j2").render(**content), status)


@PAGES.get("/")
def show_start(context: Context) -> HTMLResponse:
    """Robots, and what was done lately."""
    return render("start", robots=robot_entries(), token=bool(context.settings.token))


@PAGES.get("/login")
def show_login() -> HTMLResponse:
    """The form that asks for the token."""
    return render("login", wrong=False)


@PAGES.post("/login")
def log_in(request: Request, context: Context, token: Annotated[str, Form(max_length=1000)] = "") -> Response:
    """Give a browser its cookie."""
    wanted = context.settings.token
    if not wanted or not hmac.compare_digest(token.encode(), wanted.encode()):
        return render("login", 401, wrong=True)
    answer = RedirectResponse("/", 303)
    answer.set_cookie(
        COOKIE, session_cookie(wanted), max_age=30 * 86400, httponly=True, samesite="strict", secure=is_secure(request)
    )
    return answer


@PAGES.get("/cells/{robot}/{cell}")
def show_cell(robot: str, cell: str) -> HTMLResponse:
    """A shipped cell in 3D, and the form that starts a plan."""
    return render("cell", cell=f"{robot}/{cell}", title=f"{robot}/{cell}", dialects=dialect_entries())
