"""Log in and out: a browser gives name and password, or the token of the service, once, and keeps a cookie."""

import re
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form, Query, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from planner.common.errors import InputError
from planner.service.callers import CALLER, COOKIE, sender_of
from planner.service.context import Context, ServiceContext
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
    _give_cookie(redirect, request, cookie)
    return redirect


@LOGIN.get("/password")
def show_password(context: Context, done: bool = False) -> HTMLResponse:
    """The form by which people change their own password."""
    return _password_form(context, done=done)


@LOGIN.post("/password")
def change_password(
    request: Request, context: Context, old: Typed = "", new: Typed = "", again: Typed = ""
) -> Response:
    """Give whoever asks another password; other sessions of the person end."""
    caller, guesses = CALLER.get(), context.guesses
    if not _has_password(context):
        return _password_form(context, status=409)
    if new != again:
        return _password_form(context, "The new password was typed in two ways.", 422)
    wait = guesses.begin_try(("name", caller.name))
    if wait:
        return _password_form(context, f"Too many wrong tries. Wait {wait:.0f} s, then try again.", 429)
    try:
        cookie = context.people.change_password(caller.name, old, new)
    except InputError as err:
        return _password_form(context, f"{err}.", 422)
    if cookie is None:
        return _password_form(context, "The password until now is wrong.", 401)
    guesses.note_right(("name", caller.name))
    redirect = RedirectResponse("/password?done=true", 303)
    _give_cookie(redirect, request, cookie)
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


def _give_cookie(answer: Response, request: Request, cookie: str) -> None:
    answer.set_cookie(COOKIE, cookie, max_age=int(SESSION_S), httponly=True, samesite="lax", secure=is_secure(request))


def _has_password(context: ServiceContext) -> bool:
    """Tell whether whoever asks has logged in with a password."""
    caller = CALLER.get()
    person = context.people.find(caller.name) if caller.name and caller.cookie else None
    return person is not None and person.has_password


def _password_form(context: ServiceContext, wrong: str = "", status: int = 200, done: bool = False) -> HTMLResponse:
    return render("password", status, wrong=wrong, has_password=_has_password(context), done=done)


def _form(context: Context, wrong: str, wanted: str, status: int = 200) -> HTMLResponse:
    known, by_token = context.people.exist(), bool(context.settings.token)
    return render("login", status, wrong=wrong, wanted=wanted, known=known, by_token=by_token)
