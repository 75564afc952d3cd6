"""The connection to a Dask cluster: encrypted beyond this machine, with certificates on both sides.

A scheduler and its workers run what they are sent; so only who has a key of the cluster may talk to them. What workers
send back is data. A service reads no pickle from there: reading one runs whatever its writer wanted.
"""

import io
import ipaddress
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from pickle import Unpickler, UnpicklingError
from typing import Any
from urllib.parse import urlsplit

from planner.common.advice import Occasion, advice
from planner.common.errors import InputError, MissingProgramError

AUTHORITY, CERTIFICATE, KEY = "ca.pem", "cert.pem", "key.pem"  # files of a folder of keys
TLS = "tls"


def is_loopback(host: str) -> bool:
    """Tell whether a host is this machine, by its own name for itself."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_address(address: str, keys: Path | None, option: str) -> None:
    """Refuse the address of a scheduler beyond this machine to which a connection would not be encrypted.

    Args:
        address: such as ``tls://10.0.0.2:8786``.
        keys: folder of the cluster's keys.
        option: that named the address, for messages.

    Raises:
        InputError: saying what is needed.
    """
    parts = urlsplit(address if "://" in address else f"tcp://{address}")
    if parts.scheme == TLS and keys is None:
        raise InputError(
            f"{option} {address}: name the folder with the keys of the cluster, --cluster-keys DIR ({_key_maker()})"
        )
    if parts.scheme != TLS and keys is not None:
        raise InputError(f"{option} {address}: with --cluster-keys the address begins with tls://")
    if parts.scheme != TLS and not is_loopback(parts.hostname or ""):
        raise InputError(
            f"{option} {address}: beyond this machine a cluster needs TLS, as whoever reaches it runs what they like: "
            f"make keys ({_key_maker()}), start scheduler and workers with them (--tls-ca-file, --tls-cert, "
            f"--tls-key), and say tls://{parts.netloc} with --cluster-keys DIR"
        )


def connect(
    address: str, keys: Path | None, option: str, answer_s: float | str, name: str, only_data: bool = False
) -> Any:
    """Return the client of a cluster.

    Args:
        address, keys, option: as :func:`check_address`.
        answer_s: in which the scheduler answers [s], or a text with its unit.
        name: of the client.
        only_data: this process reads no pickle from a cluster from now on; no scheduler runs in it.

    Raises:
        InputError: the address or the keys are wrong, or the cluster listens beyond this machine without TLS.
        MissingProgramError: Dask is not installed, or nobody answers.
    """
    check_address(address, keys, option)
    try:
        from distributed import Client, Security
    except ImportError as err:
        raise MissingProgramError(f"{option} needs Dask: pip install 'edbb-planner[cluster]' installs it") from err
    security: Any = Security  # distributed says no types
    made: Any = Client
    how = {} if keys is None else {"security": security(require_encryption=True, **_key_files(keys))}
    given_back = refuse_pickles() if only_data else _nothing
    try:
        client = made(address, timeout=answer_s, set_as_default=False, name=name, **how)
    except (OSError, ValueError) as err:  # ValueError: files that are no keys
        given_back()
        raise MissingProgramError(f"{option} {address}: nobody answers ({err})") from err
    try:
        info = client.scheduler_info(n_workers=-1)
        check_listening([str(info["address"]), *map(str, info["workers"])])
    except BaseException:
        client.close()
        given_back()
        raise
    return client


def check_listening(addresses: Iterable[str]) -> None:
    """Refuse a cluster of which a part listens beyond this machine without TLS.

    Raises:
        InputError: naming its address.
    """
    for address in addresses:
        parts = urlsplit(address)
        if parts.scheme not in (TLS, "inproc") and not is_loopback(parts.hostname or ""):
            raise InputError(
                f"the cluster listens at {address} without TLS, where whoever reaches it runs what they like: start "
                f"scheduler and workers with --host 127.0.0.1, or with keys ({_key_maker()})"
            )


def _key_maker() -> str:
    """Say what makes the keys of a cluster."""
    return advice(Occasion.CLUSTER_KEYS, f"a folder with {AUTHORITY}, {CERTIFICATE} and {KEY}")


def _key_files(keys: Path) -> dict[str, str]:
    """Return the files of a folder of keys, as Dask's settings name them.

    Raises:
        InputError: one is missing.
    """
    for name in (AUTHORITY, CERTIFICATE, KEY):
        if not (keys / name).is_file():
            raise InputError(f"--cluster-keys {keys}: has no {name}; {_key_maker()}")
    certificate, key = str(keys / CERTIFICATE), str(keys / KEY)
    return {"tls_ca_file": str(keys / AUTHORITY), "tls_client_cert": certificate, "tls_client_key": key}


class UnreadPickle(Exception):
    """Stands for a pickle that came from the cluster: an error of a task, as what a task gives is data."""


def refuse_pickles() -> Callable[[], None]:
    """Let this process read no pickle from a cluster but of plain data, until what is returned is called.

    It may send any.
    """
    from distributed import client
    from distributed.protocol import pickle
    from distributed.protocol.serialize import families, register_serialization_family

    module: Any = pickle
    asserts: Any = client
    register: Any = register_serialization_family
    loads, clean, (dumps, read, _) = module.loads, asserts.clean_exception, families["dask"]

    def give_back() -> None:
        """Let pickles be read again."""
        module.loads, asserts.clean_exception = loads, clean
        register("dask", dumps, read)

    module.loads, asserts.clean_exception = _read_plain, _unread_error  # the own one asserts that a traceback is one
    register("dask", dumps, partial(_or_unread, read))  # it asks a pickle for the type
    return give_back


def _nothing() -> None:
    """Give nothing back."""


class _PlainUnpickler(Unpickler):
    """Reads a pickle of numbers, texts, bytes and lists of them, which calls nothing."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a type that holds bytes, for which Dask asks a pickle; nothing else is found.

        Raises:
            UnpicklingError: another name is asked for.
        """
        known = {kind.__name__: kind for kind in (bytes, bytearray, memoryview)}
        if module != "builtins" or name not in known:
            raise UnpicklingError(f"{module}.{name}")
        return known[name]


def _read_plain(data: Any, *, buffers: Any = ()) -> object:
    """Read a pickle of plain data; of any other return that it was not read."""
    return _or_unread(lambda: _PlainUnpickler(io.BytesIO(data), buffers=buffers).load())


def _or_unread(read: Callable[..., object], *given: object) -> object:
    try:
        return read(*given)
    except Exception as err:
        return UnreadPickle(f"an object that is no data was not read ({str(err)[:200]})")


def _unread_error(error: object, _: object = None, **__: object) -> tuple[type[Exception], Exception, None]:
    found = error if isinstance(error, Exception) else UnreadPickle(str(error)[:500])
    return type(found), found, None
