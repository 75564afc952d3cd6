"""Landlock: the process of a job reads libraries and its own folder, writes its own folder, and calls nobody.

Where the kernel has no Landlock (before Linux 5.13) nothing happens here; what a command reads as a file is confined
to the job's folder besides (:meth:`planner.common.reading.Inputs.confine`).
Source: the kernel's documentation, ``userspace-api/landlock``; numbers of system calls are those of all architectures.
"""

import os
import struct
import sys
from collections.abc import Sequence
from ctypes import CDLL, c_char_p, c_int, c_long, c_size_t, c_uint32
from pathlib import Path

_CREATE, _ADD, _RESTRICT = 444, 445, 446
_NO_NEW_PRIVILEGES = 38
_ONLY_VERSION, _RULE_PATH = 1, 1
_EXECUTE, _WRITE, _READ_FILE, _READ_FOLDER = 1, 2, 4, 8
_FILE_RIGHTS = _EXECUTE | _WRITE | _READ_FILE | 1 << 14  # the last is to truncate
RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1}  # all rights on files, by version
_ALL_NETWORK = 3  # to bind and to connect by TCP, from version 4
SYSTEM = ("/usr", "/bin", "/lib", "/lib32", "/lib64", "/etc", "/proc", "/sys/devices/system", "/nix", "/opt")


def confine_process(folder: Path, readable: Sequence[Path]) -> bool:
    """Confine this process and its children for good; return whether the kernel can.

    Args:
        folder: may be read and written.
        readable: may be read, beside the system's libraries and Python's.
    """
    if sys.platform != "linux":
        return False
    libc = CDLL(None)
    libc.syscall.restype = c_long
    version = libc.syscall(c_long(_CREATE), None, c_size_t(0), c_uint32(_ONLY_VERSION))
    if version < 1:
        return False
    rights = RIGHTS[min(version, 3)]
    rules = struct.pack("QQ", rights, _ALL_NETWORK) if version >= 4 else struct.pack("Q", rights)
    ruleset = libc.syscall(c_long(_CREATE), c_char_p(rules), c_size_t(len(rules)), c_uint32(0))
    if ruleset < 0:
        return False
    look = _EXECUTE | _READ_FILE | _READ_FOLDER
    libraries = {*SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix, *(p for p in sys.path if p)}
    for path in {*libraries, *map(str, readable)}:
        _allow(libc, ruleset, path, look & rights)
    for path in ("/dev/null", "/dev/urandom", "/dev/zero", "/dev/shm"):
        _allow(libc, ruleset, path, (_READ_FILE | _WRITE) & rights)
    _allow(libc, ruleset, str(folder), rights)
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    held: bool = libc.syscall(c_long(_RESTRICT), c_int(ruleset), c_uint32(0)) == 0
    os.close(ruleset)
    return held


def _allow(libc: CDLL, ruleset: int, path: str, rights: int) -> None:
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # this system has no such folder
        return
    if not os.path.isdir(path):
        rights &= _FILE_RIGHTS
    rule = struct.pack("=Qi", rights, handle)
    libc.syscall(c_long(_ADD), c_int(ruleset), c_int(_RULE_PATH), c_char_p(rule), c_uint32(0))
    os.close(handle)
