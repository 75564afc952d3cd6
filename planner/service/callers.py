"""Who asks: found from what a request carries (token, cookie, header of a trusted proxy), and what that one may do.

How often somebody may guess: after each wrong password or token the next try of a sender has to wait longer.
"""

import hmac
import ipaddress
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import Scope

from planner.common.errors import InputError
from planner.service.people import PeopleStore, valid_name
from planner.service.settings import LOOPBACK, ProxySettings, Role, ServiceSettings


@dataclass(frozen=True)
class Patience:
    """How long wrong tries are borne.

    Attributes:
        free_tries: wrong ones before anybody waits: people mistype.
        longest_address_s, longest_name_s: of waiting [s]; by name less, as others must not lock a person out.
        forgotten_s: without a wrong try [s].
        most_kept: senders that are remembered.
    """

    free_tries: int = 5
    longest_address_s: float = 900.0
    longest_name_s: float = 60.0
    forgotten_s: float = 3600.0
    most_kept: int = 10_000


PATIENCE = Patience()


@dataclass(frozen=True)
class WrongTries:
    """Wrong tries of one sender, and when the last one was [s of a steady clock]."""

    count: int
    last: float


class GuessLimit:
    """Counts wrong tries by sender (address, or name that is tried) in this process."""

    def __init__(self) -> None:
        self._tries: OrderedDict[tuple[str, str], WrongTries] = OrderedDict()
        self._counting = threading.Lock()

    def wait_s(self, *senders: tuple[str, str]) -> float:
        """Return how long the next try of any of these senders has to wait [s]; 0 where none has to."""
        now = time.monotonic()
        return max((self._wait(sender, now) for sender in senders), default=0.0)

    def begin_try(self, *senders: tuple[str, str]) -> float:
        """Count a try of each sender as wrong until it is known to be right; return how long it has to wait [s].

        Nothing is counted where it has to: many tries at the same moment are each looked at after the one before.
        """
        with self._counting:
            wait = self.wait_s(*senders)
            if not wait:
                self.note_wrong(*senders)
            return wait

    def note_wrong(self, *senders: tuple[str, str]) -> None:
        """Count a wrong try of each sender."""
        now = time.monotonic()
        for sender in senders:
            known = self._tries.pop(sender, None)
            count = known.count if known and now - known.last < PATIENCE.forgotten_s else 0
            self._tries[sender] = WrongTries(count + 1, now)
        while len(self._tries) > PATIENCE.most_kept:
            self._tries.popitem(last=False)

    def note_right(self, *senders: tuple[str, str]) -> None:
        """Forget the wrong tries of senders who knew it in the end."""
        for sender in senders:
            self._tries.pop(sender, None)

    def _wait(self, sender: tuple[str, str], now: float) -> float:
        known = self._tries.get(sender)
        if known is None or known.count < PATIENCE.free_tries or now - known.last > PATIENCE.forgotten_s:
            return 0.0
        longest = PATIENCE.longest_name_s if sender[0] == "name" else PATIENCE.longest_address_s
        # 1, 2, 4, ... s; 20: doublings after which it is longer than any limit
        delay = min(2.0 ** min(known.count - PATIENCE.free_tries, 20), longest)
        return max(0.0, known.last + delay - now)


def sender_of(address: str) -> str:
    """Return the key under which an address is counted: for IPv6 the subscriber's network, which has many addresses."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.version == 4:
        return str(parsed)
    return str(ipaddress.ip_network(f"{parsed}/64", strict=False))


COOKIE = "edbb_session"


class ForbiddenError(HTTPException):
    """Somebody may not do what is asked."""

    def __init__(self, text: str) -> None:
        super().__init__(403, text)


@dataclass(frozen=True)
class Caller:
    """Who asks.

    Attributes:
        name: of the person; empty where nobody has to say it, or the service's own token was given.
        role: what the caller may do.
        address: where the request came from, as far as proxies that are trusted say it.
        cookie: of the session; empty where none was used.
        unnoted: whether the use of that session is to be noted.
    """

    name: str = ""
    role: Role = Role.ADMINISTER
    address: str = ""
    cookie: str = ""
    unnoted: bool = False

    def check_role(self, needed: Role) -> None:
        """Refuse what the role does not allow.

        Raises:
            ForbiddenError: it does not.
        """
        if not self.role.covers(needed):
            raise ForbiddenError(f"{self.name}: may {self.role}; this takes somebody who may {needed}")

    def check_owner(self, person: str) -> None:
        """Refuse to change what is another person's, unless the caller is an administrator.

        Raises:
            ForbiddenError: it is another person's.
        """
        if person not in ("", self.name) and self.role is not Role.ADMINISTER:
            raise ForbiddenError(f"it is of {person}; only {person} or an administrator may do this")


NOBODY_ASKED = Caller()
CALLER: ContextVar[Caller] = ContextVar("caller", default=NOBODY_ASKED)
"""Who sent the request that is being answered."""


@dataclass(frozen=True)
class Refusal:
    """Why a request is refused: by whom it was sent is unknown, or that person may not ask for it.

    Attributes:
        status, words: of the answer.
        wait_s: how long before the next try is looked at.
        address: where the request came from.
    """

    status: int
    words: str
    wait_s: float = 0.0
    address: str = ""


class CallerFinder:
    """Finds who sent a request."""

    def __init__(
        self, settings: ServiceSettings, people: PeopleStore, guesses: GuessLimit, worker_token: str = ""
    ) -> None:
        self._settings, self._people, self._guesses, self._worker_token = settings, people, guesses, worker_token

    @property
    def is_open(self) -> bool:
        """Whether nobody has to say who asks: this machine alone is served, and nobody is known by name."""
        s = self._settings
        return s.host in LOOPBACK and not s.token and not s.proxy.user_header and not self._people.exist()

    def find(self, scope: Scope) -> Caller | Refusal:
        """Return who asks, or why it is not known."""
        headers = Headers(scope=scope)
        peer = str((scope.get("client") or ("",))[0])
        address = original_address(peer, headers.getlist("x-forwarded-for"), self._settings.proxy)
        return replace(self._find(headers, peer, address), address=address)

    def _find(self, headers: Headers, peer: str, address: str) -> Caller | Refusal:
        if self.is_open:
            return Caller()
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return self._by_token(given.strip(), address)
        named = self._by_proxy(peer, headers)
        return named or self._by_cookie(headers.get("cookie", "")) or Refusal(401, "log in first")

    def is_service_token(self, given: str) -> bool:
        """Tell whether somebody knows the token that the service was started with."""
        token = self._settings.token
        return bool(token) and hmac.compare_digest(given.encode(), token.encode())

    def _by_token(self, given: str, address: str) -> Caller | Refusal:
        # made here of 32 random bytes: nobody guesses them, so that wrong tokens of others hold off no right one
        person = self._people.by_token(given)
        if person is not None:
            return Caller(person.name, person.role)
        if self._worker_token and hmac.compare_digest(given.encode(), self._worker_token.encode()):
            return Caller("a worker", Role.LOOK)
        sender = ("token", sender_of(address))  # the service's own was chosen by a person
        wait = self._guesses.begin_try(sender)
        if wait:
            return Refusal(429, f"too many wrong tokens came from {address}; wait {wait:.0f} s", wait)
        if self.is_service_token(given):
            self._guesses.note_right(sender)
            return Caller()
        return Refusal(401, "this token is not known here")

    def _by_proxy(self, peer: str, headers: Headers) -> Caller | Refusal | None:
        """Return whom a trusted proxy names; nothing where none does."""
        proxy = self._settings.proxy
        given = headers.getlist(proxy.user_header) if proxy.user_header and proxy.trusts(peer) else []
        if not given:
            return None
        try:  # bytes of a header come as Latin-1; names are sent as UTF-8
            name = valid_name(given[0].encode("latin-1").decode())
        except (InputError, ValueError):
            return Refusal(403, "the proxy names nobody who could be known here")
        if len(given) > 1:
            return Refusal(403, "the proxy names more than one person")
        person = self._people.find(name)
        role = person.role if person else proxy.role
        if role is None:
            return Refusal(403, f"{name}: is not known here; an administrator adds people with 'edbb serve users add'")
        return Caller(name, role)

    def _by_cookie(self, cookies: str) -> Caller | None:
        try:
            kept = SimpleCookie(cookies).get(COOKIE)
        except CookieError:
            return None
        found = self._people.by_session(kept.value) if kept else None
        if kept is None or found is None:
            return None
        name, unnoted = found
        if not name:  # of the service's own token
            return Caller(cookie=kept.value, unnoted=unnoted)
        person = self._people.find(name)
        return Caller(name, person.role, cookie=kept.value, unnoted=unnoted) if person else None


def original_address(peer: str, forwarded: Sequence[str], proxy: ProxySettings) -> str:
    """Return where a request began: the last address that no trusted proxy has, as those in between say it."""
    chain = [part.strip() for line in forwarded for part in line.split(",")]
    while chain and proxy.trusts(peer):
        before = chain.pop()
        try:
            peer = str(ipaddress.ip_address(before))
        except ValueError:
            break
    return peer
