"""How often somebody may guess: after each wrong password or token the next try of a sender has to wait longer."""

import ipaddress
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass


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
