"""``edbb --server URL …``: the same command on a server, its files sent there and its results fetched."""

import hashlib
import json
import re
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from http.client import HTTPException, HTTPResponse
from itertools import pairwise
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.parse import quote, urlencode
from urllib.request import Request, urlopen

from planner.cell.reading import load_cell
from planner.cli.terminal import Screen, check_file, check_folder, environment_token, errors, results
from planner.common.errors import InputError, MissingProgramError
from planner.common.files import is_folder, is_new_folder, write_bytes, write_together
from planner.common.result_folder import MANIFEST, draft_folder, move_all
from planner.compensation.languages import other_program_files
from planner.kinematics.packages import COMMAND_PACKAGES
from planner.session.movable_cell import cell_files

FILE_VERBS = ("simulate", "export", "import", "compensate")  # -o names a file
OUTPUT = ("-o", "--output")
PACKAGE = "--package"
FORCE = "--force"
NOT_SENT = ("report.html", "residuals.csv", "timings.json", MANIFEST)
ALONE = (".csv", ".parquet", ".log", ".txt", ".src", ".mod", ".dat")  # files that need none beside them


@dataclass
class Server:
    """A service, as a script talks to it.

    Raises:
        MissingProgramError: nobody answers.
        InputError: the service refuses, with its sentence.
    """

    url: str
    token: str = ""

    def open(
        self, path: str, data: bytes | None = None, kind: str = "application/json", **headers: str
    ) -> HTTPResponse:
        """Ask, and return the open answer."""
        headers |= {"content-type": kind} if data is not None else {}
        headers |= {"authorization": f"Bearer {self.token}"} if self.token else {}
        try:
            # 60.0: [s] without an answer
            answer: HTTPResponse = urlopen(Request(self.url + path, data=data, headers=headers), timeout=60.0)
            return answer
        except HTTPError as err:
            raise InputError(f"{self.url}: {_sentence(err)}") from err
        except (URLError, OSError) as err:
            raise MissingProgramError(f"{self.url}: nobody answers ({getattr(err, 'reason', err)})") from err

    def ask(self, path: str, body: object = None) -> dict[str, object]:
        """Ask, and return what the service says."""
        with self.open(path, None if body is None else json.dumps(body).encode()) as answer:
            said = json.load(answer)
            assert isinstance(said, dict)
            return said

    def send(self, data: bytes, name: str) -> str:
        """Send a file; return its identifier."""
        known = hashlib.sha256(data).hexdigest()
        query = urlencode({"name": name, "sha256": known})
        with self.open(f"/api/files?{query}", data, "application/octet-stream"):
            return known

    def follow(self, job: str) -> Iterator[dict[str, object]]:
        """Yield the events of a job until it ends; a connection that breaks is taken up where it was."""
        most_tries = 20  # of a connection that breaks, a second apart
        last, broken = "0", 0
        while True:
            try:
                with self.open(f"/api/events?job={job}&after={last}", accept="text/event-stream") as stream:
                    for line in map(bytes.decode, stream):
                        if line.startswith("id: "):
                            last, broken = line[4:].strip(), 0
                        elif line.startswith("data: "):
                            event = json.loads(line[6:])
                            yield event
                            if "state" in event:
                                return
            except (HTTPException, OSError, MissingProgramError) as err:
                if broken == most_tries:
                    raise MissingProgramError(f"{self.url}: the connection broke {most_tries} times ({err})") from err
            broken += 1
            time.sleep(1.0)


def _sentence(err: HTTPError) -> str:
    try:
        said = json.loads(err.read())
        return str(said.get("detail") or err)
    except (ValueError, AttributeError, OSError):
        return f"{err.code} {err.reason}"


@dataclass
class RemoteWords:
    """The words of a command with the files that they name, as the server lays them out."""

    words: list[str] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)
    output: str | None = None
    _folders: dict[Path, str] = field(default_factory=dict)

    @classmethod
    def of(cls, words: Sequence[str]) -> "RemoteWords":
        """Take a command apart: every word that is a file or folder here becomes one there."""
        made, rest = cls(), iter(words)
        COMMAND_PACKAGES.set(_package_words(words))  # a URDF is made whole here, before it is sent
        for word in rest:
            if word.partition("=")[0] == PACKAGE:
                _ = next(rest, "") if word == PACKAGE else ""
                continue
            if word in OUTPUT:
                made.output = next(rest, "")
                is_file = words[0] in FILE_VERBS and not is_folder(made.output)
                there = f"out/{Path(made.output).name}" if is_file else "out/" if words[0] in FILE_VERBS else "out"
                made.words += ["-o", made.output if made.output == "-" else there]
            elif Path(word).exists() and word != words[0]:
                made.words.append(made._add(Path(word)))
            else:
                made.words.append(word)
        return made

    def _add(self, path: Path) -> str:
        """Return the path of a file or folder as it is laid out there."""
        home = path if path.is_dir() else path.parent
        folder = self._folders.setdefault(home.resolve(), f"a{len(self._folders) + 1}")
        if path.is_dir():
            self._add_folder(path, folder)
            return folder
        content = path.read_bytes()
        if path.suffix == ".toml" and b"edbb-cell/" in content:
            cell = self._folders.setdefault(path.resolve(), f"c{len(self._folders) + 1}")
            self.files |= {f"{cell}/{name}": data for name, data in cell_files(load_cell(path, planning=False)).items()}
            return f"{cell}/cell.toml"
        self.files[f"{folder}/{path.name}"] = content
        if others := other_program_files(path):
            self.files |= {f"{folder}/{p.name}": p.read_bytes() for p in others}
        elif path.suffix not in ALONE:
            self._add_folder(home, folder)
        return f"{folder}/{path.name}"

    def _add_folder(self, home: Path, folder: str) -> None:
        for path in sorted((*home.glob("*.json"), *home.glob("*.toml"), *home.glob("*.urdf"), *home.glob("meshes/*"))):
            # 200 << 20: bytes of a file beside one that is named
            if path.is_file() and path.name not in NOT_SENT and path.stat().st_size < (200 << 20):
                self.files[f"{folder}/{path.relative_to(home).as_posix()}"] = path.read_bytes()


def _package_words(words: Sequence[str]) -> list[str]:
    """Return what ``--package NAME=DIR`` or ``--package=NAME=DIR`` says."""
    after = [b for a, b in pairwise(words) if a == PACKAGE]
    return after + [word.partition("=")[2] for word in words if word.startswith(f"{PACKAGE}=")]


def run_remotely(server: Server, words: Sequence[str]) -> int:
    """Run a command on a server; return its exit code.

    Raises:
        InputError: the service refuses the command, or the results cannot be written.
        MissingProgramError: nobody answers.
    """
    command = RemoteWords.of(words)
    if command.output is not None and words[0] in FILE_VERBS:
        check_file(
            command.output, FORCE in words or words[0] == "import", into_folder=words[0] in ("compensate", "export")
        )
    elif command.output not in (None, "-"):
        check_folder(Path(str(command.output)), FORCE in words)
    with Screen() as progress:
        progress("sending", 0, 0)
        sent = [{"id": server.send(data, Path(name).name), "name": name} for name, data in command.files.items()]
        asked = {"words": command.words, "files": sent, "title": name_command(words)}
        job = server.ask("/api/commands", asked)
        for event in server.follow(str(job["id"])):
            if "stage" in event:
                progress(str(event["stage"]), int(str(event.get("done", 0))), int(str(event.get("of", 0))))
        progress("fetching", 0, 0)
        ended = server.ask(f"/api/jobs/{job['id']}")
        files = {str(f["name"]): _fetch(server, f) for f in list_of_dicts(ended["files"])}
    printed, log = files.pop("printed", b""), files.pop("log", b"").decode(errors="replace")
    said = [line for line in log.splitlines() if not line.startswith('{"stage":')]
    if said:
        errors.print("\n".join(said))
    found = printed.decode(errors="replace")
    if command.output != "-" and "--json" not in words:  # where the server has written it, and what to type there
        found = re.sub(r"^  (written to|next) .*\n", "", found, flags=re.MULTILINE)
    sys.stdout.write(found)
    if files and command.output is not None:
        results.print(f"  written to  {_write(files, command.output, words[0], FORCE in words)}")
    elif ended["problem"] and not said:
        errors.print(f"edbb: {dict(ended)['problem']}")
    code = ended["exit_code"]
    return int(str(code)) if code is not None else 1


def name_command(words: Sequence[str]) -> str:
    """Return of what a command is, as pages say it: the word after its verb, of a path the file and its folder."""
    what = words[1] if len(words) > 1 else words[0]
    return "/".join(Path(what).parts[-2:])[-120:]  # letters of a title


def list_of_dicts(value: object) -> list[dict[str, object]]:
    """Return a list of objects of an answer."""
    return [v for v in value if isinstance(v, dict)] if isinstance(value, list) else []


def _fetch(server: Server, file: dict[str, object]) -> bytes:
    with server.open(quote(str(file["url"]))) as answer:
        data: bytes = answer.read()
    if hashlib.sha256(data).hexdigest() != file["sha256"]:
        raise InputError(
            f"{server.url}: '{file['name']}' came damaged; run the command again: nothing is computed twice"
        )
    return data


def _write(files: dict[str, bytes], wanted: str, verb: str, force: bool) -> str:
    """Write the results where the command would have; return where."""
    output = Path(wanted)
    if verb in FILE_VERBS:
        folder = output if is_folder(wanted) else output.parent
        if is_new_folder(wanted):
            folder.mkdir(parents=True, exist_ok=True)
        write_together([(folder / name, data) for name, data in files.items()], force=force)
        return ", ".join(str(folder / name) for name in files)
    with draft_folder(output) as draft:
        for name, data in files.items():
            if name != MANIFEST:
                (draft / name).parent.mkdir(parents=True, exist_ok=True)
                write_bytes(draft / name, data)
        move_all(draft, output, force)
    return str(output)


def run_on_server(url: str, words: Sequence[str]) -> int:
    """Run a command on the service at an address, with the token of the environment; return its exit code.

    Raises:
        InputError: the service refuses the command, or the results cannot be written.
        MissingProgramError: nobody answers.
    """
    return run_remotely(Server(url.rstrip("/"), environment_token()), words)
