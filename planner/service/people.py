"""Who may use the service: people with roles, their passwords and tokens, and the sessions of their browsers.

Passwords are kept as Argon2id hashes (RFC 9106), tokens and cookies as SHA-256 of random values: nothing that is kept
lets anybody in.

The log of deeds: who changed what and when.
"""

import hashlib
import hmac
import secrets
import sqlite3
import threading
import time
import unicodedata
from dataclasses import dataclass

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from planner.common.errors import InputError
from planner.service.database import Database
from planner.service.settings import DAY_S, Role

SESSION_S, IDLE_S = 7 * DAY_S, DAY_S / 2  # [s] that a browser stays logged in: at most, and while nobody uses it
HASHING = threading.BoundedSemaphore(2)  # a password takes 64 MB to check: guesses at the same time wait


TRACES = tuple(
    f"SELECT 1 FROM {table} WHERE person = ? LIMIT 1"
    for table in ("jobs", "askers", "deeds", "uploads", "cell_sessions", "session_ticks")
)
"""Questions whether somebody of a name has done something here."""


@dataclass(frozen=True)
class Person:
    """Somebody who may use the service.

    Attributes:
        name: as it is typed.
        role: what the person may do.
        has_password: whether a browser may log in; else only tokens or a proxy let the person in.
        tokens: labels of the tokens for programs.
    """

    name: str
    role: Role
    has_password: bool
    tokens: tuple[str, ...]


def valid_name(text: str) -> str:
    """Return a name as it is kept.

    Raises:
        InputError: it is empty, longer than 64 letters, or has signs that cannot be seen.
    """
    name = unicodedata.normalize("NFC", text.strip())
    if not 0 < len(name) <= 64 or not name.isprintable():
        raise InputError(f"{text!r}: a name has 1 to 64 letters that can be seen")
    return name


def valid_password(text: str) -> str:
    """Return a password.

    Raises:
        InputError: it is too short or too long.
    """
    shortest, longest = 10, 200  # signs: shorter ones are guessed, longer ones only cost time
    if not shortest <= len(text) <= longest:
        raise InputError(f"the password has {len(text)} signs; {shortest} to {longest} are allowed")
    return text


class PeopleStore:
    """The people of a database.

    Args:
        database: of the service.
        seal: secret of the service that sessions belong to: with another one all of them end.
    """

    def __init__(self, database: Database, seal: str = "") -> None:
        self._db, self._seal = database, seal.encode()
        self._hasher = PasswordHasher()
        self._nobody = ""  # hash that is checked where there is no such person: it takes as long

    def exist(self) -> bool:
        """Tell whether anybody is known by name; then everybody has to log in."""
        return bool(self._db.read("SELECT 1 FROM people LIMIT 1"))

    def list_people(self) -> list[Person]:
        """Return all people by name."""
        return [self._person(row) for row in self._db.read("SELECT * FROM people ORDER BY name")]

    def find(self, name: str) -> Person | None:
        """Return somebody."""
        rows = self._db.read("SELECT * FROM people WHERE name = ?", name)
        return self._person(rows[0]) if rows else None

    def add(self, name: str, role: Role, password: str | None, same_person: bool = False) -> None:
        """Add somebody; without a password only tokens or a proxy let the person in.

        ``same_person``: who has worked here under this name before.

        Raises:
            InputError: the name is or was somebody's, or none, the password too short, or the first no administrator.
        """
        name, kept = valid_name(name), self._hash(password)
        with self._db.write() as db:
            names = [row["name"] for row in db.execute("SELECT name FROM people")]
            if twin := next((known for known in names if known.casefold() == name.casefold()), None):
                raise InputError(f"{twin}: is known already; another password is set by 'edbb serve users passwd'")
            if not same_person and any(db.execute(query, (name,)).fetchone() for query in TRACES):
                raise InputError(
                    f"{name}: somebody of this name has worked here, and what was done stays under it; give another "
                    "person another name, or say --same-person"
                )
            if role is not Role.ADMINISTER and _administrators(db) == 0:
                raise InputError(f"{name}: the first person has to be an administrator (--role administer)")
            db.execute("INSERT INTO people VALUES (?, ?, ?, ?)", (name, role.value, kept, time.time()))

    def set_password(self, name: str, password: str) -> None:
        """Give somebody another password; the person's browsers have to log in again.

        Raises:
            InputError: there is nobody of that name, or the password is too short.
        """
        kept = self._hash(password)
        with self._db.write() as db:
            if not db.execute("UPDATE people SET password = ? WHERE name = ?", (kept, name)).rowcount:
                raise _unknown_error(name)
            db.execute("DELETE FROM sessions WHERE person = ?", (name,))

    def set_role(self, name: str, role: Role) -> None:
        """Let somebody do more or less.

        Raises:
            InputError: there is nobody of that name, or no administrator would be left.
        """
        with self._db.write() as db:
            if not db.execute("UPDATE people SET role = ? WHERE name = ?", (role.value, name)).rowcount:
                raise _unknown_error(name)
            if _administrators(db) == 0:
                raise InputError(f"{name}: is the last administrator; make somebody else one first")

    def remove(self, name: str) -> None:
        """Remove somebody with sessions and tokens; what the person did stays in the log and at the jobs.

        Raises:
            InputError: there is nobody of that name, or no administrator would be left.
        """
        with self._db.write() as db:
            if not db.execute("DELETE FROM people WHERE name = ?", (name,)).rowcount:
                raise _unknown_error(name)
            if _administrators(db) == 0:
                raise InputError(f"{name}: is the last administrator; make somebody else one first")
            db.execute("DELETE FROM sessions WHERE person = ?", (name,))
            db.execute("DELETE FROM tokens WHERE person = ?", (name,))

    def make_token(self, name: str, label: str) -> str:
        """Return a new token for a program of somebody; an earlier one of that label ends.

        Raises:
            InputError: there is nobody of that name.
        """
        token = f"edbb_{secrets.token_urlsafe(32)}"  # bytes: cannot be guessed
        with self._db.write() as db:
            if not db.execute("SELECT 1 FROM people WHERE name = ?", (name,)).fetchone():
                raise _unknown_error(name)
            db.execute("DELETE FROM tokens WHERE person = ? AND label = ?", (name, label))
            row = (hashlib.sha256(token.encode()).hexdigest(), name, label, time.time())
            db.execute("INSERT INTO tokens VALUES (?, ?, ?, ?)", row)
        return token

    def end_token(self, name: str, label: str) -> None:
        """End a token's validity.

        Raises:
            InputError: there is none.
        """
        with self._db.write() as db:
            if not db.execute("DELETE FROM tokens WHERE person = ? AND label = ?", (name, label)).rowcount:
                raise InputError(f"{name}: has no token '{label}'; see 'edbb serve users list'")

    def log_in(self, name: str, password: str) -> tuple[Person, str] | None:
        """Return who has this name and password, and the cookie of a new session; nothing where nobody has."""
        known, kept = self._verify(name, password)
        with self._db.write() as db:  # the password may have been changed, and its sessions ended, while it was checked
            person = known and _with_password(db, known, kept)
            return (self._person(person), self._open_session(db, known)) if person else None

    def change_password(self, name: str, old: str, new: str) -> str | None:
        """Give somebody who knows the old password another one; return the cookie of a new session, the others end.

        Nothing is changed, and nothing returned, where the old one is wrong.

        Raises:
            InputError: the new password is too short or too long.
        """
        made = self._hash(new)
        known, kept = self._verify(name, old)
        with self._db.write() as db:
            if not known or _with_password(db, known, kept) is None:
                return None
            db.execute("UPDATE people SET password = ? WHERE name = ?", (made, known))
            db.execute("DELETE FROM sessions WHERE person = ?", (known,))
            return self._open_session(db, known)

    def _verify(self, name: str, password: str) -> tuple[str, str]:
        """Return the name as it is kept, and the hash of the password; empty where it is wrong.

        It takes as long where there is nobody of that name.
        """
        rows = self._db.read("SELECT * FROM people WHERE name = ?", unicodedata.normalize("NFC", name.strip()))
        with HASHING:
            self._nobody = self._nobody or self._hasher.hash(secrets.token_hex())
            kept = (rows and rows[0]["password"]) or self._nobody
            try:
                self._hasher.verify(kept, password)
            except (VerificationError, InvalidHashError):
                return "", ""
        return (rows[0]["name"], kept) if rows and kept != self._nobody else ("", "")

    def by_token(self, token: str) -> Person | None:
        """Return whose token this is."""
        known = hashlib.sha256(token.encode()).hexdigest()
        rows = self._db.read("SELECT people.* FROM tokens JOIN people ON name = person WHERE sha256 = ?", known)
        return self._person(rows[0]) if rows else None

    def open_token_session(self) -> str:
        """Return the cookie of a new session of the service's own token, which is nobody's by name."""
        with self._db.write() as db:
            return self._open_session(db, "")

    def _open_session(self, db: sqlite3.Connection, name: str) -> str:
        cookie, now = secrets.token_urlsafe(32), time.time()  # bytes: cannot be guessed
        db.execute("DELETE FROM sessions WHERE opened < ? OR seen < ?", (now - SESSION_S, now - IDLE_S))
        db.execute("INSERT INTO sessions VALUES (?, ?, ?, ?)", (self._seal_cookie(cookie), name, now, now))
        return cookie

    def close_session(self, cookie: str) -> None:
        """End a session."""
        with self._db.write() as db:
            db.execute("DELETE FROM sessions WHERE sha256 = ?", (self._seal_cookie(cookie),))

    def by_session(self, cookie: str) -> tuple[str, bool] | None:
        """Return whose session a cookie is, and whether its use should be noted; nothing where it has ended."""
        now, sealed = time.time(), self._seal_cookie(cookie)
        rows = self._db.read("SELECT person, opened, seen FROM sessions WHERE sha256 = ?", sealed)
        if not rows or now - rows[0]["opened"] > SESSION_S or now - rows[0]["seen"] > IDLE_S:
            return None
        # 60.0: [s] after which the use is noted anew
        return rows[0]["person"], now - rows[0]["seen"] > 60.0

    def note_use(self, cookie: str) -> None:
        """Note that a session is used."""
        with self._db.write() as db:
            db.execute("UPDATE sessions SET seen = ? WHERE sha256 = ?", (time.time(), self._seal_cookie(cookie)))

    def _seal_cookie(self, cookie: str) -> str:
        return hmac.new(self._seal, cookie.encode(), hashlib.sha256).hexdigest()

    def _hash(self, password: str | None) -> str:
        if password is None:
            return ""
        with HASHING:
            return self._hasher.hash(valid_password(password))

    def _person(self, row: sqlite3.Row) -> Person:
        found = self._db.read("SELECT label FROM tokens WHERE person = ? ORDER BY label", row["name"])
        return Person(row["name"], Role(row["role"]), bool(row["password"]), tuple(r["label"] for r in found))


def _with_password(db: sqlite3.Connection, name: str, kept: str) -> sqlite3.Row | None:
    """Return somebody whose password is still kept as this hash."""
    found: sqlite3.Row | None = db.execute(
        "SELECT * FROM people WHERE name = ? AND password = ?", (name, kept)
    ).fetchone()
    return found


def _administrators(db: sqlite3.Connection) -> int:
    return int(db.execute("SELECT count(*) FROM people WHERE role = 'administer'").fetchone()[0])


def _unknown_error(name: str) -> InputError:
    return InputError(f"{name}: there is nobody of that name; see 'edbb serve users list'")


@dataclass(frozen=True)
class Deed:
    """Something that somebody did; ``id`` rises, ``at`` in seconds since 1970, ``status`` is that of the answer."""

    id: int
    at: float
    person: str
    address: str
    deed: str
    subject: str
    status: int


class DeedLog:
    """All deeds of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def add(self, person: str, address: str, deed: str, subject: str, status: int) -> None:
        """Add a deed to the log."""
        row = (time.time(), person, address, deed, subject[:200], status)
        with self._db.write() as db:
            db.execute("INSERT INTO deeds (at, person, address, deed, subject, status) VALUES (?, ?, ?, ?, ?, ?)", row)

    def list_deeds(self, person: str | None, before: int | None, most: int) -> list[Deed]:
        """Return the latest deeds, of one person or of all, before a number where one is given."""
        where, values = "1", list[object]()
        if person is not None:
            where, values = f"{where} AND person = ?", [*values, person]
        if before is not None:
            where, values = f"{where} AND id < ?", [*values, before]
        query = f"SELECT id, at, person, address, deed, subject, status FROM deeds WHERE {where} ORDER BY id DESC"
        return [Deed(*row) for row in self._db.read(f"{query} LIMIT ?", *values, most)]
