"""A cluster beyond this machine needs keys; who has none gets in nowhere, and what comes back is data."""

import os
import re
import socket
import ssl
import stat
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from planner.common.cluster import check_address, check_listening, connect
from planner.common.errors import InputError
from planner.service.cluster_work import WorkEnd
from planner.service.settings import ClusterSettings
from tests.command import edbb
from tests.service.test_cluster import free_port

FAR = ["tcp://10.0.0.2:8786", "10.0.0.2:8786", "ws://plant.example:8786", "tcp://[fd00::2]:8786", "tcp://0.0.0.0:8786"]
NEAR = ["tcp://127.0.0.1:8786", "localhost:8786", "tcp://[::1]:8786", "tcp://127.8.0.1:1"]
EVIL = """
import os, sys
from pathlib import Path
from planner.common.cluster import connect

class Evil:
    def __reduce__(self):
        return (open, (sys.argv[3], "w"))

def evil(_): return Evil()
def nested(_): return {"state": "done", "files": {"a": Evil()}}
def fails(_): raise type("Odd", (Exception,), {"__reduce__": lambda self: (open, (sys.argv[3], "w"))})("x")
def good(_): return {"state": "done", "files": {"a.csv": b"1" * 3_000_000}, "list": [1, 2.5, None, True]}

client = connect(sys.argv[1], Path(sys.argv[2]), "--cluster", 20.0, "test", only_data=True)
for work in (evil, nested, fails):
    try:
        found = repr(client.submit(work, 0, pure=False).result(timeout=300))
    except Exception as err:
        found = repr(err)
    assert "Evil object" not in found, found
    assert not Path(sys.argv[3]).exists(), work
found = client.submit(good, 0, pure=False).result(timeout=300)
assert found["files"]["a.csv"] == b"1" * 3_000_000, found
assert list(found["list"]) == [1, 2.5, None, True], found
print("data alone")
client.close()
"""


def is_kept_out(port, context=None):
    """Tell whether a stranger is given no word by what listens there, with TLS but no certificate, or without TLS."""
    with socket.create_connection(("127.0.0.1", int(port)), timeout=60) as plain:
        try:
            with context.wrap_socket(plain) if context else plain as connection:
                connection.sendall(b"\x00" * 64)
                return connection.recv(100) == b""
        except OSError:  # ssl.SSLError is one
            return True


@pytest.mark.parametrize("address", FAR)
def test_beyond_this_machine_nothing_goes_without_keys(address, tmp_path):
    with pytest.raises(InputError, match=r"needs TLS.*edbb serve keys DIR"):
        ClusterSettings(address, "https://edbb.plant")
    with pytest.raises(InputError, match="needs TLS"):
        connect(address, None, "--scheduler", 1.0, "x")
    done = edbb("serve", "--cluster", address, "--cluster-url", "https://edbb.plant", "--data", tmp_path / "d")
    assert done.returncode == 2
    assert "needs TLS" in (done.stdout + done.stderr)


@pytest.mark.parametrize("address", NEAR)
def test_this_machine_alone_needs_none(address):
    check_address(address, None, "--cluster")
    ClusterSettings(address, "http://127.0.0.1:8017")


def test_settings_that_do_not_fit_together_are_refused(tmp_path):
    with pytest.raises(InputError, match="name the folder with the keys"):
        ClusterSettings("tls://10.0.0.2:8786", "https://edbb.plant")
    with pytest.raises(InputError, match="begins with tls://"):
        ClusterSettings("tcp://127.0.0.1:8786", "http://127.0.0.1", tmp_path)
    with pytest.raises(InputError, match="by https alone"):
        ClusterSettings("tls://10.0.0.2:8786", "http://10.0.0.2:8017", tmp_path)
    with pytest.raises(InputError, match=r"has no ca\.pem"):
        connect("tls://10.0.0.2:8786", tmp_path, "--cluster", 1.0, "x")
    with pytest.raises(InputError, match=r"listens at tcp://10\.0\.0\.3:1 without TLS"):
        check_listening(["tcp://127.0.0.1:1", "tcp://10.0.0.3:1"])
    check_listening(["tls://10.0.0.3:1", "inproc://a/b", "tcp://127.0.0.1:1"])


def test_what_a_worker_sends_is_read_as_data():
    end = WorkEnd("done", 0, None, False, {"out/a.csv": b"1"})
    assert WorkEnd.of(end.data()) == end
    for bad in (
        {"state": "odd"},
        {"state": "done", "files": {"../x": b""}},
        {"state": "done", "files": {"/x": b""}},
        3,
    ):
        with pytest.raises(ValueError, match=r"validation error|is no name"):
            WorkEnd.of(bad)


def started(stack, log, *words):
    process = subprocess.Popen([sys.executable, "-m", *map(str, words)], stdout=log, stderr=log, cwd=log.name + ".d")
    stack.callback(process.kill)
    return process


@pytest.mark.slow
def test_keys_let_in_and_pickles_stay_unread(tmp_path):
    pytest.importorskip("cryptography")
    pytest.importorskip("distributed")
    keys = tmp_path / "keys"
    assert edbb("serve", "keys", keys).returncode == 0
    assert edbb("serve", "keys", keys).returncode == 2
    if os.name == "posix":
        assert stat.S_IMODE((keys / "key.pem").stat().st_mode) == 0o600
        assert stat.S_IMODE(keys.stat().st_mode) == 0o700
    address = f"tls://127.0.0.1:{free_port()}"
    tls = [f"--tls-{k}={keys / f}" for k, f in (("ca-file", "ca.pem"), ("cert", "cert.pem"), ("key", "key.pem"))]
    (tmp_path / "log.d").mkdir()
    with ExitStack() as stack:
        log = stack.enter_context((tmp_path / "log").open("wb"))
        port = address.rpartition(":")[2]
        where = ("--host", "127.0.0.1", "--no-dashboard", "--protocol", "tls")
        started(stack, log, "distributed.cli.dask_scheduler", "--port", port, *where, *tls)
        started(stack, log, "distributed.cli.dask_worker", address, "--nthreads", 1, "--no-nanny", *where, *tls)
        script = tmp_path / "evil.py"
        script.write_text(EVIL)

        def run(*words):
            return subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, timeout=120)

        until = time.monotonic() + 60
        done = run(script, address, keys, tmp_path / "owned")
        while "nobody answers" in (done.stdout + done.stderr) and time.monotonic() < until:
            done = run(script, address, keys, tmp_path / "owned")
        assert "data alone" in done.stdout, (done.stdout + done.stderr)[-3000:] + Path(log.name).read_text()[-3000:]
        assert not (tmp_path / "owned").exists()
        ports = [port, *re.findall(r"Start worker at: +tls://127\.0\.0\.1:(\d+)", Path(log.name).read_text())]
        assert len(ports) == 2
        for each in ports:
            context = ssl.create_default_context(cafile=keys / "ca.pem")
            context.check_hostname = False
            assert is_kept_out(each, context)
            assert is_kept_out(each)
            context.load_cert_chain(keys / "cert.pem", keys / "key.pem")
            with socket.create_connection(("127.0.0.1", int(each)), timeout=60) as plain:
                assert context.wrap_socket(plain).recv(1)  # who has the keys is greeted
