"""Files are read with a word for what is wrong, appear whole or not at all; data folders are found here."""

import hashlib
import json
import os
import stat
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from planner.common.errors import InputError
from planner.common.exchange import draft_prefix, remove, replace_together, writing_error
from planner.common.file_names import check_names
from planner.common.finite_documents import check_finite, check_finite_content


class Inputs:
    """The files that the present command has read; nothing is kept before a command begins to watch them."""

    def __init__(self) -> None:
        self.watching = False
        self._seen: set[tuple[int, int]] = set()
        self._within: tuple[Path, ...] = ()

    def confine(self, folders: Sequence[Path]) -> None:
        """From now on let nothing outside these folders be read: the files may be a stranger's."""
        self._within = tuple(f.resolve() for f in folders)

    def allows(self, path: Path) -> bool:
        """Tell whether the file at ``path`` may be read."""
        return not self._within or any(path.resolve().is_relative_to(f) for f in self._within)

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Keep what is read while a command runs."""
        self.watching, self._seen = True, set()
        try:
            yield
        finally:
            self.watching, self._seen = False, set()

    def add(self, found: os.stat_result) -> None:
        """Note that a file was read."""
        if self.watching:
            self._seen.add((found.st_dev, found.st_ino))

    def holds(self, path: Path) -> bool:
        """Tell whether the file at ``path`` was read, by whatever name."""
        try:
            found = path.stat()
        except OSError:
            return False
        return (found.st_dev, found.st_ino) in self._seen


INPUTS = Inputs()
MOST_TEXT = 100_000_000  # bytes of a settings, plan or program file
MOST_TOML = 20_000_000  # bytes of a TOML, URDF or SRDF file


def check_read_access(path: Path) -> None:
    """Refuse a file that may not be read, in the same words whether it is there or not.

    Raises:
        InputError: it lies outside the folders that this process may read.
    """
    if not INPUTS.allows(path):
        raise InputError(f"{path}: lies outside the folder of this job; send the file along and name it alone")


def check_readable(path: Path, most_bytes: int = MOST_TEXT, advice: str = "") -> None:
    """Refuse what is no plain file (a folder, a device, a pipe), or is larger than it can be in earnest.

    Raises:
        InputError: naming the file, its size and what is allowed.
    """
    try:
        check_read_access(path)
        found = os.stat(path)
    except (OSError, ValueError) as err:
        reason = err.strerror if isinstance(err, OSError) and err.strerror else str(err)
        raise InputError(f"{path}: cannot be read ({reason})") from err
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
        held = [path / name for name in ("plan.json", "robot.toml", "cell.toml") if (path / name).is_file()]
        hint = f"; it holds {' and '.join(map(str, held))}" if held else ""
        raise InputError(f"{path}: cannot be read (it is {kind}, and a file is needed){hint}")
    if found.st_size > most_bytes:
        raise InputError(f"{path}: has {found.st_size} bytes, at most {most_bytes} are read{advice and '; '}{advice}")
    INPUTS.add(found)


def read_bytes(path: Path, most_bytes: int = MOST_TEXT, advice: str = "") -> bytes:
    """Return the content of a plain file.

    Raises:
        InputError: as :func:`check_readable`, or the file may not be read.
    """
    check_readable(path, most_bytes, advice)
    try:
        return path.read_bytes()
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err


def text_hash(data: bytes) -> str:
    """Return the SHA-256 of a text whose lines end by one character, as everything that is written here does."""
    return hashlib.sha256(data.replace(b"\r\n", b"\n")).hexdigest()


def has_hash(data: bytes, digest: str) -> bool:
    """Tell whether ``data`` has this SHA-256, or had it before git or an editor ended its lines as Windows does."""
    return digest in (hashlib.sha256(data).hexdigest(), text_hash(data))


UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")  # the mark U+FEFF in either order of bytes


def announced_encoding(data: bytes) -> str:
    """Return UTF-16 where a byte order mark says it, as in what Excel calls Unicode text, else UTF-8."""
    return "utf-16" if data.startswith(UTF_16_MARKS) else "utf-8-sig"


def read_utf8(path: Path, most_bytes: int = MOST_TEXT) -> str:
    """Return the text of a plain file in UTF-8, its line ends as any program reads them, without a byte order mark.

    UTF-16 is read too, where a byte order mark says it.

    Raises:
        InputError: as :func:`read_bytes`, or the bytes are no UTF-8.
    """
    data = read_bytes(path, most_bytes)
    try:
        text = data.decode(announced_encoding(data))
    except UnicodeDecodeError as err:
        line = data.count(b"\n", 0, err.start) + 1
        said = f"the byte 0x{data[err.start]:02X} is no UTF-8; save the file in UTF-8 (Notepad: Save as, Encoding)"
        raise InputError(f"{path}, line {line}: {said}") from err
    return text.replace("\r\n", "\n").replace("\r", "\n")


def write_text(path: Path, text: str, encoding: str = "utf-8", own: bool = False, force: bool = False) -> None:
    """Write ``text`` to ``path`` as it is (line ends are kept), replacing what was there in one step.

    Raises:
        InputError: the folder does not exist, or may not be written, or the text does not fit ``encoding``.
    """
    write_bytes(path, encode_text(path, text, encoding), own, force)


def encode_text(path: Path, text: str, encoding: str) -> bytes:
    """Return the bytes of ``text`` as it is to be written to ``path``.

    Raises:
        InputError: the text does not fit ``encoding``.
    """
    try:
        return text.encode(encoding)
    except UnicodeEncodeError as err:
        raise InputError(f"{path}: the character {text[err.start]!r} does not exist in {encoding}") from err


def document_text(content: object) -> str:
    """Return the text of a JSON file as all are written: one space for each level, letters as they are.

    Raises:
        NotFiniteError: a number of it is nan or infinite.
    """
    check_finite_content(content)
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def write_bytes(path: Path, data: bytes, own: bool = False, force: bool = False) -> None:
    """Write ``data`` to ``path``; a failure leaves the old file, or none, and no temporary file.

    A link is followed, a device is written to. With ``own`` the caller may replace the file, whatever it holds. With
    ``force`` a person has allowed to replace a file that somebody else has written.

    Raises:
        InputError: the folder does not exist, or may not be written; this command has read the file, or somebody else
            has written it, and overwriting was not asked for.
    """
    write_together([(path, data)], own, force)


def write_together(files: Sequence[tuple[Path, bytes]], own: bool = False, force: bool = False) -> None:
    """Write files that need one another, each as :func:`write_bytes`; the first is the one that a person starts.

    All are on the disk under temporary names before one takes its own, so a full disk leaves what was there. They take
    their names all together or not at all, as :func:`replace_together` does it.

    Raises:
        InputError: as :func:`write_bytes`.
        NotFiniteError: a number of a document is nan or infinite.
    """
    for path, data in files:
        check_names(path)
        check_finite(path, data)
    drafts: list[tuple[Path, Path]] = []
    try:
        for path, data in files:
            try:
                drafts += _draft(path.resolve(), data, own, force)
            except (OSError, RuntimeError, ValueError) as err:
                raise writing_error(path, err) from err
        replace_together(drafts)
    finally:
        for draft, _ in drafts:
            remove(draft)


def _draft(path: Path, data: bytes, own: bool, force: bool) -> list[tuple[Path, Path]]:
    """Put ``data`` on the disk beside ``path``, under a temporary name; a device is written to, and has none."""
    if path.exists() and not path.is_file() and not path.is_dir():
        path.write_bytes(data)
        return []
    if not own:
        _check_overwriting(path, data, force)
    handle, name = tempfile.mkstemp(prefix=draft_prefix(), dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(name, _file_mode(path))
    except BaseException:
        remove(Path(name))
        raise
    return [(Path(name), path)]


def check_writing(path: Path, data: bytes = b"", force: bool = False) -> None:
    """Refuse a file that :func:`write_bytes` would refuse, before anything is changed; ``data``: what is to be written.

    Raises:
        InputError: this command has read it, or somebody else has written it, or it is the name of no file.
    """
    check_names(path)
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # a name that no file can have
        if path.is_file():
            _check_overwriting(path.resolve(), data, force)
    except (OSError, ValueError) as err:
        raise writing_error(path, err) from err


OWN_MARKS = (b"plan_id", b"edbb")  # one of them stands at the head of every single file that is written


def _check_overwriting(path: Path, data: bytes, force: bool) -> None:
    """Refuse to write over what was read, or what neither is the same nor bears a mark of this tool."""
    if INPUTS.holds(path):
        raise InputError(f"{path}: this command has read it and does not write over it; name another file with -o")
    if not INPUTS.watching or force or not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(1 << 16)  # bytes of the file's head; the truth of a simulated run may stand before its mark
    if head and not data.startswith(head) and not any(mark in head for mark in OWN_MARKS):
        raise InputError(f"{path}: is there already, and was not written by edbb; name another file, or add --force")


def _file_mode(path: Path) -> int:
    """Return the permissions that the file has, or that a newly opened one would get."""
    if path.exists():
        return path.stat().st_mode & 0o777
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask


def is_folder(output: Path | str) -> bool:
    """Tell whether what is named for the files to be written is a folder: it is there already, or ends in a slash."""
    return Path(output).is_dir() or is_new_folder(output)


def is_new_folder(output: Path | str) -> bool:
    """Tell whether a name ends as that of a folder, which is made where there is none."""
    return str(output).endswith(("/", os.sep))


def folder_of(path: Path) -> Path:
    """Return a folder that is named by itself, or by a file in it."""
    return path.parent if path.is_file() else path


_PACKAGE = Path(__file__).resolve().parents[1]


def data_folder(name: str) -> Path:
    """Return the packaged data folder ``name`` if it is there, else the checkout's.

    Raises:
        FileNotFoundError: the installation holds neither.
    """
    for candidate in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the data folder '{name}' is missing from this installation")
