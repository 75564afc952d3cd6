"""Wine with the folder that is unzipped on Windows: built once, and what is run in it.

Wine 8 lacks what Windows 10 has: its C library has no complex functions (numpy imports ``crealf``), and
bcryptprimitives.dll (polars and pydantic load it) is not there. Both are laid beside ``python.exe``: in the system
folder Wine's own services would load them, and break.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
USER = "Jürgen Groß"
PATIENCE_S = 1200  # [s]; Wine doubles the time, and the machine may be busy
RANDOM = """
#include <windows.h>
BOOLEAN WINAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE p, SIZE_T n) { return SystemFunction036(p, (ULONG)n); }
BOOL WINAPI DllMain(HINSTANCE h, DWORD r, LPVOID v) { return TRUE; }
"""
TESTED_BY = (
    "pytest",
    "pluggy",
    "iniconfig",
    "packaging",
    "hypothesis",
    "sortedcontainers",
    "lark",
    "execnet",
    "pytest-xdist",
)
"""Libraries of tests, in the versions of this environment."""
C_LIBRARY = "org.bytedeco:javacpp:1.5.14:jar:windows-x86_64"  # carries Microsoft's ucrtbase.dll
QUIET = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def require_wine():
    """Skip, and say what is missing."""
    missing = [name for name in ("wine", "wineserver") if not _path_of(name)]
    if not missing and _version() < 9:
        missing = [name for name in ("x86_64-w64-mingw32-gcc", "mvn") if not shutil.which(name)]
    if missing:
        pytest.skip(f"Wine is missing, or what it needs: {', '.join(missing)} (apt-get install wine64 mingw-w64 maven)")


def _path_of(name):
    return shutil.which(name) or shutil.which(name, path="/usr/lib/wine")


def _version():
    said = subprocess.run(["wine", "--version"], capture_output=True, text=True, check=True).stdout
    return int(re.search(r"wine-(\d+)", said)[1])


class Wine:
    """A prefix of Wine in a folder, with the unzipped program in ``C:\\users\\Jürgen Groß\\edbb test``."""

    def __init__(self, folder, packed):
        self.prefix = folder / "prefix"
        self.env = {
            **{k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "OPENBLAS", "COLUMNS"))},
            "WINEPREFIX": str(self.prefix), "WINEARCH": "win64", "WINEDEBUG": "-all", "LC_ALL": "C.UTF-8",
            "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "WINEDLLOVERRIDES": "mscoree,mshtml=",
        }  # fmt: skip
        self.home = self.prefix / "drive_c" / "users" / USER / "edbb test"
        if not self.prefix.is_dir():
            self._wine("wineboot", "-u")
            self._wine("winecfg", "-v", "win10")
            debugger = ("/v", "ShowCrashDialog", "/t", "REG_DWORD", "/d", "0", "/f")
            self._wine("reg", "add", r"HKCU\Software\Wine\WineDbg", *debugger)
        # Wine's services start here: they must not inherit a pipe, or whoever reads that waits for ever
        subprocess.run([_path_of("wineserver"), "-p"], env=self.env, start_new_session=True, check=False, **QUIET)
        self._wine("cmd", "/c", "exit")
        if not self.home.is_dir():
            self.home.mkdir(parents=True)
            zipfile.ZipFile(packed).extractall(self.home)
        self.program = next(self.home.glob("edbb-*"))
        self.python = self.program / "python" / "python.exe"
        if _version() < 9:
            self._fill_holes(folder)

    def _wine(self, *words):
        subprocess.run(["wine", *words], env=self.env, start_new_session=True, check=True, timeout=600, **QUIET)

    def _fill_holes(self, folder):
        """Lay what Wine 8 lacks beside ``python.exe``, to be loaded from there."""
        kept = folder / "dlls"
        if not kept.is_dir():
            kept.mkdir()
            get = ["mvn", "-q", "-B", "dependency:copy", f"-Dartifact={C_LIBRARY}", f"-DoutputDirectory={kept}"]
            subprocess.run(get, check=True, **QUIET)
            with zipfile.ZipFile(next(kept.glob("*.jar"))) as jar:
                for name in jar.namelist():
                    if re.search(r"(ucrtbase|api-ms-win-crt-[^/]*)\.dll$", name):
                        (kept / Path(name).name).write_bytes(jar.read(name))
            (kept / "random.c").write_text(RANDOM)
            library = kept / "bcryptprimitives.dll"
            compile_it = ["x86_64-w64-mingw32-gcc", "-shared", "-O2", "-o", library, kept / "random.c", "-ladvapi32"]
            subprocess.run(compile_it, check=True)
        for file in kept.glob("*.dll"):
            if not (self.python.parent / file.name).is_file():  # it may be in use
                shutil.copy(file, self.python.parent)
        self.env["WINEDLLOVERRIDES"] += "".join(f";{file.stem}=n,b" for file in kept.glob("*.dll"))

    def windows(self, path):
        """The name by which Windows knows a path of this machine."""
        drive = self.prefix / "drive_c"
        path = Path(path)
        inside = path.is_relative_to(drive)
        return ("C:\\" + str(path.relative_to(drive)) if inside else "Z:" + str(path)).replace("/", "\\")

    def start(self, *words, cwd=None, env=None, **how):
        """Start a program of Windows; paths among the words are given by their names there."""
        named = [self.windows(w) if isinstance(w, Path) else str(w) for w in words]
        how = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT} | how
        return subprocess.Popen(["wine", *named], cwd=cwd or self.home, env={**self.env, **(env or {})}, **how)

    def run(self, *words, timeout=300, input=None, **how):
        """Run a program of Windows to its end; return exit code and all that it said."""
        if input is not None:
            how["stdin"] = subprocess.PIPE
        process = self.start(*words, **how)
        try:
            said = process.communicate(input, timeout=timeout)[0] or b""
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        return process.returncode, said.decode("utf-8", errors="replace").replace("\r\n", "\n")

    def edbb(self, *words, code=0, **how):
        """Run the command by its launcher, and return what it said; the exit code is looked at."""
        got, said = self.run(self.program / "edbb.exe", *words, **how)
        assert got == code, said
        return said

    def renew(self):
        """Put the project as it is now into a folder that was unzipped earlier."""
        site, made = self.python.parent / "Lib" / "site-packages", self.prefix.parent / "wheel"
        shutil.rmtree(made, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", made, ROOT], check=True)
        shutil.rmtree(site / "planner")
        zipfile.ZipFile(next(made.glob("*.whl"))).extractall(site)

    def testing_python(self):
        """A Python with the same libraries, this checkout and what tests need; the unzipped folder stays as it is."""
        home = self.prefix / "drive_c" / "testing"
        python, site = home / "python", home / "site"
        if not python.is_dir():
            shutil.copytree(self.program / "python", python, copy_function=os.link)
            words = ["-m", "pip", "install", "-q", "--no-deps", "--only-binary=:all:", "--platform", "win_amd64"]
            words += ["--python-version", "3.11", "--target", site, *(f"{n}=={version(n)}" for n in TESTED_BY)]
            subprocess.run([sys.executable, *words], check=True)
            search = python / "python311._pth"
            search.unlink()  # it is the same file as that of the unzipped folder
            search.write_text(
                f"{self.windows(ROOT)}\n..\\site\npython311.zip\n.\nLib\\site-packages\n", encoding="utf-8"
            )
        return python / "python.exe"

    def end(self, word, how=signal.SIGKILL):
        """End the programs of this prefix that were started with a word; SIGINT is Ctrl-C to them."""
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                words = (process / "cmdline").read_bytes().split(b"\0")
                if word.encode() in words and os.fsencode(self.prefix) in (process / "environ").read_bytes():
                    os.kill(int(process.name), how)

    def stop(self):
        """End all that runs in the prefix."""
        subprocess.run([_path_of("wineserver"), "-k"], env=self.env, check=False, **QUIET)


def build_folder(to):
    """Make the folder's zip as the release does, and return its path."""
    subprocess.run(
        [ROOT / ".ci" / "release", "--windows", to], check=True, env={**os.environ, "PYTHON": sys.executable}
    )
    return next(to.glob("edbb-*-windows.zip"))
