"""Where the service listens, where it keeps its files, and what a job may use."""

import ipaddress
import os
import re
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from urllib.parse import urlsplit

from planner.common.cluster import check_address, is_loopback
from planner.common.errors import InputError
from planner.common.lazy_modules import psutil

LOOPBACK = ("127.0.0.1", "::1", "localhost")
TOKEN_VARIABLE = "EDBB_TOKEN"
GB = 1 << 30  # bytes
DAY_S = 86_400.0  # [s] of a day


@dataclass(frozen=True)
class JobLimits:
    """What one job may use: resident memory [bytes] of its processes together, and time [s]."""

    memory_bytes: int = 4 * GB
    time_s: float = 7200.0


@dataclass(frozen=True)
class Retention:
    """How long jobs are kept; ``None``: for ever.

    Attributes:
        age_s: jobs that ended longer ago may go [s].
        size_bytes: the oldest may go while all files together are larger.
    """

    age_s: float | None = None
    size_bytes: int | None = None

    @classmethod
    def of(cls, days: float | None, gigabytes: float | None) -> "Retention":
        """Return the rule that keeps jobs by age [days] and total size [GB]."""
        age = None if days is None else days * DAY_S
        return cls(age, None if gigabytes is None else int(gigabytes * GB))

    @property
    def limited(self) -> bool:
        """Whether jobs are deleted at some age, or from some size of the store on."""
        return self.age_s is not None or self.size_bytes is not None


class Role(StrEnum):
    """What a person may do; each may do what stands before it too."""

    LOOK = "look"
    WORK = "work"
    ADMINISTER = "administer"

    def covers(self, needed: "Role") -> bool:
        """Tell whether this role may do what another one may."""
        order = list(Role)
        return order.index(self) >= order.index(needed)


@dataclass(frozen=True)
class ProxySettings:
    """Proxies that stand before the service.

    Attributes:
        networks: addresses or networks of them; what they say of where a request came from is believed.
        user_header: header in which they name who has logged in there; empty where they do not.
        role: what those may do whom the service does not know by name; ``None``: nothing.
    """

    networks: tuple[str, ...] = ()
    user_header: str = ""
    role: Role | None = None

    def __post_init__(self) -> None:
        for network in self.networks:
            try:
                ipaddress.ip_network(network)
            except ValueError as err:
                raise InputError(f"--proxy {network}: an address or a network such as 10.0.0.0/24 is needed") from err
        if self.user_header and not self.networks:
            raise InputError("--proxy-user: name the proxy that is trusted, such as --proxy 127.0.0.1")
        if not re.fullmatch(r"[A-Za-z0-9-]*", self.user_header):
            raise InputError(f"--proxy-user {self.user_header}: a name of a header such as X-Forwarded-User is needed")

    def trusts(self, address: str) -> bool:
        """Tell whether an address is that of a trusted proxy."""
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError:
            return False
        mapped = parsed.ipv4_mapped if isinstance(parsed, ipaddress.IPv6Address) else None
        return any((mapped or parsed) in ipaddress.ip_network(n) for n in self.networks)


@dataclass(frozen=True)
class ClusterSettings:
    """Where jobs are computed that this machine does not compute.

    Attributes:
        scheduler: address of a Dask scheduler, such as ``tls://10.0.0.4:8786``; empty: here.
        url: by which its workers reach this service.
        keys: folder of the keys by which the cluster is reached, ``None`` on this machine alone.
        answer_s: in which the scheduler answers [s], or is taken for gone.
    """

    scheduler: str = ""
    url: str = ""
    keys: Path | None = None
    answer_s: float = 10.0

    def __post_init__(self) -> None:
        if not self.scheduler:
            return
        check_address(self.scheduler, self.keys, "--cluster")
        parts = urlsplit(self.url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise InputError("--cluster-url: say by which address workers reach this service, https://edbb.plant:8017")
        if parts.scheme == "http" and not is_loopback(parts.hostname):
            raise InputError(
                f"--cluster-url {self.url}: workers beyond this machine read files by https alone: name the address of "
                "the proxy before this service that encrypts"
            )


@dataclass(frozen=True)
class WebhookSettings:
    """Who is told when a job ends.

    Attributes:
        urls: addresses that notices are sent to.
        private: whether they may lie in private networks or on this machine.
        secret: by which notices are signed; empty: they are not.
        pauses_s: between tries of a notice that nobody takes [s]; the last one again and again.
        answer_s: that a receiver may take [s].
    """

    urls: tuple[str, ...] = ()
    private: bool = False
    secret: str = field(default="", repr=False)
    pauses_s: tuple[float, ...] = (1.0, 5.0, 30.0, 120.0, 600.0)
    answer_s: float = 10.0

    def __post_init__(self) -> None:
        for url in self.urls:
            parts = urlsplit(url)
            if parts.scheme not in ("http", "https") or not parts.hostname or parts.username or parts.password:
                raise InputError(f"--webhook {url}: an address such as https://mes.plant.example/edbb is needed")


@dataclass(frozen=True)
class Quota:
    """What one person may have at a time; ``None``: as much as the machine has.

    Attributes:
        jobs: that wait or run.
        size_bytes: of all files that the person's jobs have written and the person has sent.
    """

    jobs: int | None = None
    size_bytes: int | None = None


@dataclass(frozen=True)
class ServiceSettings:
    """All that the service is told.

    Attributes:
        folder: store of jobs and files.
        host, port: address to listen on.
        names: further names by which a browser may call this host.
        token: lets a program or a browser do everything, where it is not empty; never printed.
        proxy: what stands before the service.
        quota: of each person.
        cluster: where jobs are computed.
        webhooks: who is told when a job ends.
        root_path: where the service lies on its host behind a proxy, such as ``/edbb``.
        access_log: file of a line a request, ``-`` for standard error; empty: none.
        workers: most commands at a time.
        beside: short tasks of a page that may run beside them.
        limits: of each job.
        most_upload: bytes of one file.
        reserve: bytes that must stay free on the disk.
        kept: how long jobs are kept.
    """

    folder: Path
    host: str = "127.0.0.1"
    port: int = 8017
    names: tuple[str, ...] = ()
    token: str = field(default="", repr=False)
    workers: int = os.cpu_count() or 1
    beside: int = 1
    limits: JobLimits = JobLimits()
    most_upload: int = GB
    reserve: int = GB // 4
    kept: Retention = Retention()
    proxy: ProxySettings = ProxySettings()
    quota: Quota = Quota()
    cluster: ClusterSettings = ClusterSettings()
    webhooks: WebhookSettings = WebhookSettings()
    access_log: str = ""
    root_path: str = ""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"(/[A-Za-z0-9._~-]+)*", self.root_path):
            raise InputError(f"--root-path {self.root_path}: a path such as /edbb is needed, with no slash at its end")
        shortest_token = 16  # signs: shorter ones can be guessed
        if self.token and (len(self.token) < shortest_token or not self.token.isascii()):
            raise InputError(
                f"{TOKEN_VARIABLE}: has {len(self.token)} signs; at least {shortest_token}, all of ASCII, are needed"
            )

    def check_door(self, people_known: bool) -> None:
        """Refuse to serve others where nobody has to say who asks.

        Raises:
            InputError: nobody has to.
        """
        if self.host not in LOOPBACK and not (self.token or self.proxy.user_header or people_known):
            raise InputError(
                f"--host {self.host}: on an address that others reach people have to log in. Name them "
                f"(edbb serve users add NAME --role administer), set the environment variable {TOKEN_VARIABLE} "
                f"(a long random word), or listen on 127.0.0.1"
            )


def default_folder() -> Path:
    """Return the folder of the store where none is named."""
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "edbb"


CONTAINER_LIMIT = Path("/sys/fs/cgroup/memory.max")


def machine_memory() -> int:
    """Return the memory [bytes] of this machine, or of the container that it runs in."""
    total = int(psutil.virtual_memory().total)
    try:
        return min(total, int(CONTAINER_LIMIT.read_text(encoding="ascii")))
    except (OSError, ValueError):  # no container, or one without a limit ("max")
        return total


@dataclass(frozen=True)
class JobShares:
    """How many commands run at a time, how many short tasks of a page beside them, and the memory [bytes] of each."""

    workers: int
    beside: int
    memory_bytes: int

    def limits(self, time_s: float) -> JobLimits:
        """Return the limits of one job, its time [s] included."""
        return JobLimits(self.memory_bytes, time_s)


def share_memory(workers: int, memory_bytes: int | None, total: int) -> JobShares:
    """Return how many jobs may run so that their limits together stay within the machine's memory.

    Args:
        workers: most commands at a time.
        memory_bytes: of one job; ``None``: as much as one more than ``workers`` can have.
        total: memory of the machine [bytes].

    Raises:
        InputError: the machine has not as much as one job is to have.
    """
    # 0.9: of the machine's memory that jobs may use together; the rest is for the system and the service
    usable = int(0.9 * total)
    if memory_bytes is None:
        least = min(GB, usable)
        memory_bytes = max(least, usable // (workers + 1))
    slots = usable // memory_bytes
    if slots < 1:
        raise InputError(
            f"--memory-gb {memory_bytes / GB:.3g}: this machine has {total / GB:.3g} GB, of which jobs may use "
            f"{usable / GB:.3g} GB"
        )
    return JobShares(max(1, min(workers, slots - 1)), min(1, slots - 1), memory_bytes)
