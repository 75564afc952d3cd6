"""What stands before every request: who may ask, how much may be sent, and what a browser may do with the answer."""

import hashlib
import hmac
import ipaddress
import socket
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from planner.service.problems import ProblemResponse
from planner.service.settings import LOOPBACK, ServiceSettings

UPLOADS = ("/api/files", "/api/runs")
OPEN = ("/login", "/static/")  # what is there without a token
COOKIE = "edbb_session"
SAFE = ("GET", "HEAD", "OPTIONS")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (  # a report has its scripts inside; in a sandbox it is of no origin and reaches nothing
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; frame-ancestors 'none'"
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "x-frame-options": "DENY",
}


class BodyTooLargeError(HTTPException):
    """More was sent than may be."""

    def __init__(self, most: int) -> None:
        super().__init__(413, f"at most {most} bytes are taken")


def session_cookie(token: str) -> str:
    """Return what a browser keeps instead of the token."""
    return hmac.new(token.encode(), b"edbb session", hashlib.sha256).hexdigest()


class Guard:
    """ASGI middleware: Host, Origin, token, size of the body, and headers of the answer."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app, self._settings = app, settings
        self._names = {n.lower() for n in (*LOOPBACK, *settings.names, settings.host, socket.gethostname())}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        guarded = self._add_headers(send)
        refusal = self._refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, guarded)
            return
        await self._app(scope, _count_bytes(receive, self._most_body(scope)), guarded)

    def _refusal(self, scope: Scope) -> ProblemResponse | RedirectResponse | None:
        headers, path = Headers(scope=scope), str(scope["path"])
        host = headers.get("host", "")
        if not self._is_known(host):
            return ProblemResponse(421, "this service is not known by that name; see edbb serve --name")
        origin = headers.get("origin")
        if origin is not None and _host_of(origin) != host.lower():
            return ProblemResponse(403, "requests from other sites are refused")
        if headers.get("sec-fetch-site") == "cross-site" and scope["method"] not in SAFE:
            return ProblemResponse(403, "requests from other sites are refused")
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self._most_body(scope):
            return ProblemResponse(413, f"at most {self._most_body(scope)} bytes are taken")
        if self._is_allowed(headers) or path.startswith(OPEN):
            return None
        if path.startswith("/api/") or scope["method"] not in SAFE:
            answer = ProblemResponse(401, "a token is needed: the header 'Authorization: Bearer …'")
            answer.headers["www-authenticate"] = "Bearer"
            return answer
        return RedirectResponse("/login", 303)

    def _is_known(self, host: str) -> bool:
        """An address cannot be pointed elsewhere by a foreign name server; a name must be one of ours."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
            ipaddress.ip_address(name)
        except ValueError:
            return host.partition(":")[0].lower() in self._names
        return True

    def _is_allowed(self, headers: Headers) -> bool:
        token = self._settings.token
        if not token:
            return True
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and hmac.compare_digest(given.strip().encode(), token.encode()):
            return True
        try:
            kept = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return kept is not None and hmac.compare_digest(kept.value.encode(), session_cookie(token).encode())

    def _most_body(self, scope: Scope) -> int:
        # 1 << 20: bytes of any body but an upload's
        return self._settings.most_upload if scope["path"] in UPLOADS else (1 << 20)

    @staticmethod
    def _add_headers(send: Send) -> Send:
        async def with_headers(message: Message) -> None:
            """Send the answer with the headers of safety."""
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
                headers.setdefault("content-security-policy", POLICY)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        return with_headers


def _host_of(origin: str) -> str:
    """Return host and port of an origin; nothing of one that is none, such as ``null``."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _count_bytes(receive: Receive, most: int) -> Receive:
    taken = 0

    async def receive_some() -> Message:
        """Take in a part of the body, as long as it is not too large."""
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > most:
            raise BodyTooLargeError(most)
        return message

    return receive_some


def is_secure(request: Request) -> bool:
    """Tell whether the browser came by TLS, itself or up to a proxy on this machine."""
    return request.url.scheme == "https" or request.headers.get("x-forwarded-proto") == "https"
