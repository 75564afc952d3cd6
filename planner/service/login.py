"""Log in and out: a browser gives name and password, or the token of the service, once, and keeps a cookie."""

import re
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form, Query, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from planner.service.callers import CALLER, COOKIE
from planner.service.context import Context
from planner.service.guesses import sender_of
from planner.service.people import SESSION_S
from planner.service.rendering import render

LOGIN = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
OWN_PATH = re.compile(r"/(?![/\\])[!-\[\]-~]*")  # of this service: no other host, nothing that cannot be seen
Target = Annotated[str, Query(alias="next", max_length=500)]
Typed = Annotated[str, Form(max_length=1000)]


def login_address(path: str) -> str:
    """Return where a browser logs in that wanted to see a page."""
    return "/login" if path == "/" else f"/login?next={quote(path, safe='/')}"


@LOGIN.get("/login")
def show_login(context: Context, wanted: Target = "/") -> HTMLResponse:
    """The form that asks who somebody is."""
    return _form(context, "", wanted)


@LOGIN.post("/login")
def log_in(
    request: Request, context: Context, wanted: Target = "/", name: Typed = "", password: Typed = "", token: Typed = ""
) -> Response:
    """Give a browser its cookie."""
    address, guesses = CALLER.get().address, context.guesses
    senders = [("address", sender_of(address)), *([("name", name.strip()[:64])] if name else [])]
    wait = guesses.begin_try(*senders)
    if wait:
        answer = _form(context, f"Too many wrong tries. Wait {wait:.0f} s, then try again.", wanted, 429)
        answer.headers["retry-after"] = f"{wait:.0f}"
        return answer
    who, cookie = name[:64], ""
    if name:
        found = context.people.log_in(name, password)
        if found is not None:
            who, cookie = found[0].name, found[1]
    elif token and context.finder.is_service_token(token):
        cookie = context.people.open_token_session()
    request.scope["edbb.person"] = who
    if not cookie:
        text = "Name or password is wrong." if name else "This is not the token of this service."
        return _form(context, text, wanted, 401)
    guesses.note_right(*senders)
    redirect = RedirectResponse(wanted if OWN_PATH.fullmatch(wanted) else "/", 303)
    redirect.set_cookie(
        COOKIE,
        cookie,
        max_age=int(SESSION_S),
        httponly=True,
        samesite="lax",
        secure=is_secure(request),
    )
    return redirect


@LOGIN.post("/logout")
def log_out(request: Request, context: Context) -> Response:
    """End the session of a browser."""
    cookie = CALLER.get().cookie
    if cookie:
        context.people.close_session(cookie)
    answer = RedirectResponse("/login", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="lax", secure=is_secure(request))
    return answer


def is_secure(request: Request) -> bool:
    """Tell whether the browser came by TLS, itself or up to a proxy."""
    return request.url.scheme == "https" or request.headers.get("x-forwarded-proto") == "https"


def _form(context: Context, wrong: str, wanted: str, status: int = 200) -> HTMLResponse:
    known, by_token = context.people.exist(), bool(context.settings.token)
    return render("login", status, wrong=wrong, wanted=wanted, known=known, by_token=by_token)
