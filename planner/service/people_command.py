"""``edbb serve users``: add, list, change and remove the people of a service, whether it runs or not."""

import getpass
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.common.errors import InputError
from planner.service.database import Database
from planner.service.people import PeopleStore, valid_password
from planner.service.private_store import DATABASE, keep_private
from planner.service.settings import Role

HOW = (
    "edbb serve users add NAME --role work | list | passwd NAME | role NAME --role look | remove NAME | "
    "token NAME --label ROBOT | untoken NAME --label ROBOT"
)


@dataclass(frozen=True)
class UserOptions:
    """What is said beside the name.

    Attributes:
        role: of somebody who is added or changed.
        label: what a token is for.
        no_password: a proxy or a token lets the person in, no password does.
        same_person: who is added has worked here under that name before.
    """

    role: Role | None = None
    label: str = "program"
    no_password: bool = False
    same_person: bool = False


def change_people(
    words: Sequence[str], options: UserOptions, folder: Path, say: Callable[[str], None], write: Callable[[str], None]
) -> None:
    """Do what the words behind ``edbb serve users`` say; ``write`` prints results, ``say`` tells what was done.

    Raises:
        InputError: the words say nothing that can be done.
    """
    for notice in keep_private(folder):
        say(notice)
    people = PeopleStore(Database(folder / DATABASE))
    match tuple(words):
        case ("list",):
            _list_people(people, write)
        case ("add", name):
            role = options.role or Role.WORK
            people.add(name, role, None if options.no_password else read_password(name), options.same_person)
            say(f"{name} may {role}")
        case ("passwd", name):
            people.set_password(name, read_password(name))
            say(f"{name} has another password and has to log in again")
        case ("role", name) if options.role is not None:
            people.set_role(name, options.role)
            say(f"{name} may {options.role}")
        case ("remove", name):
            people.remove(name)
            say(f"{name} is removed, with sessions and tokens")
        case ("token", name):
            write(people.make_token(name, options.label))
            say(f"the token '{options.label}' of {name}: it is shown only now; a program gives it in EDBB_TOKEN")
        case ("untoken", name):
            people.end_token(name, options.label)
            say(f"the token '{options.label}' of {name} has ended")
        case _:
            raise InputError(f"edbb serve users {' '.join(words)}: say one of {HOW}")


def _list_people(people: PeopleStore, write: Callable[[str], None]) -> None:
    for person in people.list_people():
        ways = [*(["password"] if person.has_password else []), *(f"token '{t}'" for t in person.tokens)]
        write(f"{person.name}  {person.role}  {', '.join(ways) or 'only by a proxy'}")


def read_password(name: str) -> str:
    """Return a password that is typed twice, or the first line of standard input where that is no terminal.

    Raises:
        InputError: the two differ, or it is too short.
    """
    if not sys.stdin.isatty():
        return valid_password(sys.stdin.readline().rstrip("\r\n"))
    first = valid_password(getpass.getpass(f"password of {name}: "))
    if getpass.getpass("again: ") != first:
        raise InputError("the two passwords differ; nothing was changed")
    return first
