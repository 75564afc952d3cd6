"""Which waiting job is next, and when a job will be done: people take turns, and each person's short jobs go first.

Among people the one goes first who has the fewest jobs running, then whose last job began the longest ago. Among the
jobs of one person the one of the highest response ratio, (waiting + length) / length, goes first (Brinch Hansen 1971):
short jobs pass long ones, and no job waits for ever, as its own ratio grows while it waits.
"""

import sqlite3
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class WaitingJob:
    """A job that waits; ``created`` in seconds since 1970, ``length_s`` as expected of it."""

    id: str
    person: str
    created: float
    length_s: float

    def response_ratio(self, now: float) -> float:
        """Return waiting and running time over the running time alone (highest response ratio next)."""
        return (max(0.0, now - self.created) + self.length_s) / self.length_s


@dataclass(frozen=True)
class Turns:
    """Who had how many turns: running jobs of each person, and when the last one began [s since 1970]."""

    running: Mapping[str, int]
    last_start: Mapping[str, float]


@dataclass(frozen=True)
class Outlook:
    """When a job is to be done.

    Attributes:
        position: its place among those that wait, from 1; 0 where it runs.
        left_s: until it is done [s], by the mean of like jobs; ``None`` where none was done yet.
    """

    position: int
    left_s: float | None


def order_jobs(waiting: Sequence[WaitingJob], turns: Turns, now: float) -> list[WaitingJob]:
    """Return the jobs in the order in which they begin, if each lasts as long as any other."""
    own: dict[str, list[WaitingJob]] = {}
    for job in sorted(waiting, key=lambda j: (-j.response_ratio(now), j.created, j.id), reverse=True):
        own.setdefault(job.person, []).append(job)  # the last is the first to go
    running, last = Counter(turns.running), dict(turns.last_start)
    found = []
    for turn in range(len(waiting)):
        person = min(own, key=lambda p: (running[p], last.get(p, 0.0), own[p][-1].created, p))
        found.append(own[person].pop())
        running[person] += 1
        last[person] = now + 1.0 + turn
        if not own[person]:
            del own[person]
    return found


def expected_lengths(db: sqlite3.Connection, kinds: Iterable[str]) -> dict[str, float]:
    """Return the mean length [s] of the latest jobs of each kind; a kind of which none was done is left out."""
    like = 20  # jobs, the latest, whose mean length is expected of the next
    query = (
        "SELECT avg(length), count(*) FROM (SELECT finished - started AS length FROM jobs"
        " WHERE kind = ? AND state = 'done' AND started IS NOT NULL ORDER BY created DESC LIMIT ?)"
    )
    rows = {kind: db.execute(query, (kind, like)).fetchone() for kind in set(kinds)}
    return {kind: max(0.1, float(row[0])) for kind, row in rows.items() if row[1]}


def length_of(kind: str, lengths: Mapping[str, float]) -> float:
    """Return how long a job is taken to last [s], also where no like job was ever done."""
    return lengths.get(kind, 60.0)


def read_turns(db: sqlite3.Connection, people: Iterable[str]) -> Turns:
    """Return the turns that people had."""
    names = sorted(set(people))
    running = dict(
        db.execute("SELECT person, count(*) FROM jobs WHERE state = 'running' AND task = 0 GROUP BY person").fetchall()
    )
    # the latest hundred of each: a job that began later than it stands in the list changes little
    latest = "SELECT started FROM jobs WHERE person = ? AND task = 0 ORDER BY created DESC LIMIT 100"
    query = f"SELECT max(started) FROM ({latest})"
    last = {name: db.execute(query, (name,)).fetchone()[0] for name in names}
    return Turns(running, {name: at for name, at in last.items() if at is not None})


def read_order(db: sqlite3.Connection, now: float, firsts_only: bool) -> list[WaitingJob]:
    """Return the jobs that wait, tasks of pages left out, in their order.

    ``firsts_only``: only the first of each person and kind; they suffice to know which is next.
    """
    first = "id, person, kind, min(created) AS created" if firsts_only else "id, person, kind, created"
    group = "GROUP BY person, kind" if firsts_only else ""
    rows = db.execute(f"SELECT {first} FROM jobs WHERE state = 'queued' AND task = 0 {group}").fetchall()
    lengths = expected_lengths(db, (r["kind"] for r in rows))
    jobs = [WaitingJob(r["id"], r["person"], r["created"], length_of(r["kind"], lengths)) for r in rows]
    return order_jobs(jobs, read_turns(db, (j.person for j in jobs)), now)


def next_job(db: sqlite3.Connection, now: float) -> tuple[str, bool] | None:
    """Return which job begins next, and whether it is a task of a page: those go first, the oldest before."""
    task = db.execute("SELECT id FROM jobs WHERE state = 'queued' AND task = 1 ORDER BY created, id LIMIT 1").fetchone()
    if task is not None:
        return task["id"], True
    order = read_order(db, now, firsts_only=True)
    return (order[0].id, False) if order else None


def foresee_ends(db: sqlite3.Connection, workers: int, now: float) -> dict[str, Outlook]:
    """Return when each job that waits or runs is to be done, by its identifier; tasks of pages are left out.

    ``db`` must be within one transaction.
    """
    open_jobs = "SELECT id, kind, state, started FROM jobs WHERE state IN ('queued', 'running') AND task = 0"
    rows = {r["id"]: r for r in db.execute(open_jobs).fetchall()}
    lengths, found, before = expected_lengths(db, {r["kind"] for r in rows.values()}), dict[str, Outlook](), 0.0
    for id, row in rows.items():
        if row["state"] == "running":
            spent, own = now - row["started"], lengths.get(row["kind"])
            before += max(0.0, length_of(row["kind"], lengths) - spent)
            found[id] = Outlook(0, None if own is None else max(0.0, own - spent))
    for place, job in enumerate(read_order(db, now, firsts_only=False), start=1):
        own = lengths.get(rows[job.id]["kind"])
        found[job.id] = Outlook(place, None if own is None else before / max(1, workers) + own)
        before += job.length_s
    return found


@dataclass(frozen=True)
class Foresight:
    """What is foreseen of all jobs: when that was [s of a steady clock], and the outlook of each."""

    at: float
    outlooks: Mapping[str, Outlook]

    def find(self, id: str, state: str, now: float) -> Outlook | None:
        """Return the outlook of a job; ``None`` if it is too old, or is from before the job was begun."""
        good_for_s = 1.0  # many pages ask for their jobs at once
        found = self.outlooks.get(id) if now - self.at < good_for_s else None
        return found if found is not None and (found.position == 0) == (state == "running") else None
