"""Finds what is not plain: sentences of more than 25 words, and turns that a reader stumbles over.

``python -m docs.plain_words [FILE ...]`` lists them, by default of all pages and of the program.
"""

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MOST_WORDS = 25  # words of a sentence, as ASD-STE100 allows them in descriptions
BANNED = (
    "what is told", "is told of", "as far as that may be", "asks nothing of you", "ask nothing of you", "nought",
    "which hangs", "that is all of it", "gone", "freed", "held for known", "hold for known", "to be looked at",
    "takes along", "brings along", "makes no other", "by themselves alone", "of one's own", "is no more",
    "lets expect", "whatever it is", "in vain", "as well as it can",
    "95 of 100 robots", "95 of 100 such robots", "95 of 100 arms",  # of targets alone; of how sure it is: 95 % sure
)  # fmt: skip
"""Turns that have a plain word in their place; whole words, small letters."""
BANNED_ON_PAGES = ("beside", r"held(?![ -]out)", "told", "for which that holds", "whom nobody")
"""Further ones, which pages do not have; "held out" is a term of the field."""
OTHER_WORDS = {
    "error source": "cause", "joint offset": "zero", "measurement pose": "pose", "measuring pose": "pose",
    "calibration pose": "pose", "tool centre point": "tool point", "tcp": "tool point", "ballbar": "ball bar",
    "leg": "segment", "mounting pose": "mount pose", "stiffness": "compliance", "sigma level": "standard deviation",
    "working space": "workspace", "work space": "workspace", "hold-out": "held out", "confidence": "probability",
}  # fmt: skip
"""Words that somebody else may use for a thing, with the glossary's own word; titles and code may have them."""
CODE = re.compile(r"^ *```.*?^ *```$|<!-- effects.*?/effects -->|<!--.*?-->", re.MULTILINE | re.DOTALL)
ABBREVIATIONS = re.compile(r"\b(e\.g|i\.e|et al|cf|vs|Nos?|Dr|St|[A-Z])\.")


@dataclass(frozen=True)
class Fault:
    """A sentence that is not plain: where it is, what is wrong, and the sentence."""

    place: str
    what: str
    sentence: str

    def __str__(self) -> str:
        return f"{self.place}: {self.what}: {self.sentence}"


def page_sentences(markdown: str) -> Iterator[str]:
    """Yield the sentences of a page: of its running text, its lists and the cells of its tables, without code."""
    text = re.sub(r"<[^>]+>", "", CODE.sub("\n\n", markdown))
    text = re.sub(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\](\([^)\s]*\)|\[\w*\])", r"\1", text)  # links: their words
    text = re.sub(r"`[^`]*`", "Code", text)
    blocks: list[str] = []
    for line in text.splitlines():
        if line.lstrip().startswith("|"):
            blocks += [cell for part in re.split(r"(?<!\\)\|", line) for cell in (part, "")]
        elif re.match(r"\s*([-*+]|\d+\.)\s", line) or line.startswith("#") or not line.strip():
            blocks += ["", re.sub(r"^\s*([-*+#]+|\d+\.)\s+", "", line)]
        elif re.match(r"\[\w+\]: |:::|!!!", line):
            continue
        elif blocks and blocks[-1]:
            blocks[-1] += f" {line.strip()}"
        else:
            blocks.append(line.strip())
    for block in blocks:
        yield from split_sentences(block)


def split_sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a text: they end with a stop, a question mark or a colon, as in ASD-STE100."""
    text = ABBREVIATIONS.sub(r"\1", re.sub(r"\*+", "", text))
    for part in re.split(r"(?<=[.?!:])\s+", text):
        if part.strip():
            yield part.strip()


def count_words(sentence: str) -> int:
    """Return how many words a sentence has; numbers, signs and dashes alone are none."""
    return len([w for w in sentence.split() if re.search(r"[A-Za-z]{2}|^[aAI]$", w)])


def program_texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a module that a person may read, with their lines: no docstrings, keys, patterns."""
    nodes = nodes_of(path)
    docstrings = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    bare = {id(n.value) for n in nodes if isinstance(n, ast.Expr)}
    parts = {id(v) for n in nodes if isinstance(n, ast.JoinedStr) for v in n.values}
    no_texts = docstrings | bare | parts
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            text = "".join(str(v.value) if isinstance(v, ast.Constant) else "X" for v in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in no_texts:
            text = node.value
        else:
            continue
        if len(text.split()) > 3 and not re.search(r"[\\{}<>]|^\s*#|\(\?|\b(CREATE|ALTER) TABLE\b", text):
            yield node.lineno, text


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all nodes of a module, itself first; each file is parsed once in a process."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def docstring_sentences(path: Path) -> Iterator[str]:
    """Yield the sentences of a module's docstrings; each attribute, argument and error begins a new one."""
    for node in nodes_of(path):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
            for part in re.split(r"\n\s*\n|\n(?=\s*\w+(?:, \w+)*: )", text):
                yield from split_sentences(" ".join(part.split()))


def template_sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a template of a page: what stands between its tags."""
    text = re.sub(r"<(script|style).*?</\1>|\{#.*?#\}|\{%.*?%\}", "\n", text, flags=re.DOTALL)
    for part in re.split(r"<[^>]*>|\n", re.sub(r"\{\{.*?\}\}", "X", text, flags=re.DOTALL)):
        yield from split_sentences(part)


def find_faults(place: str, sentences: Iterator[str], banned: tuple[str, ...] = BANNED) -> Iterator[Fault]:
    """Yield the faults of sentences."""
    for sentence in sentences:
        if (count := count_words(sentence)) > MOST_WORDS:
            yield Fault(place, f"{count} words", sentence)
        others = OTHER_WORDS if banned is not BANNED and "bibliography" not in place else {}
        for word, own in others.items():
            if re.search(rf"\b{word}s?\b", sentence.lower()):
                yield Fault(place, f"'{word}': the glossary calls it '{own}'", sentence)
        if not _any_of(banned).search(sentence.lower()):
            continue
        for turn in banned:
            if re.search(rf"\b{turn}\b", sentence.lower()):
                yield Fault(place, f"'{turn.partition('(')[0]}'", sentence)


@cache
def _any_of(banned: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{'|'.join(banned)})\b")


MADE = ROOT / "docs" / "papers.md"
"""Made by ``edbb papers`` from the numbers and the words of the papers; no person writes it."""


def pages() -> list[Path]:
    """Return the pages that a person writes."""
    written = sorted(set((ROOT / "docs").rglob("*.md")) - {MADE})
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *written]


def modules() -> list[Path]:
    """Return the modules of the program."""
    return sorted((ROOT / "planner").rglob("*.py"))


def page_faults(path: Path) -> list[Fault]:
    """Return the faults of a page."""
    name = path.resolve().relative_to(ROOT).as_posix()
    return list(find_faults(name, page_sentences(path.read_text(encoding="utf-8")), BANNED + BANNED_ON_PAGES))


def program_faults(path: Path) -> list[Fault]:
    """Return the faults of the messages of a module."""
    name = path.resolve().relative_to(ROOT).as_posix()
    return [f for line, text in program_texts(path) for f in find_faults(f"{name}:{line}", split_sentences(text))]


def template_faults(path: Path) -> list[Fault]:
    """Return the faults of a template."""
    name = path.resolve().relative_to(ROOT).as_posix()
    return list(find_faults(name, template_sentences(path.read_text(encoding="utf-8"))))


def templates() -> list[Path]:
    """Return the templates of pages and reports."""
    return sorted((ROOT / "planner").rglob("*.html.j2"))


def main() -> None:
    """List the faults of the files that are named, or of all."""
    named = [Path(word) for word in sys.argv[1:]] or [*pages(), *modules(), *templates()]
    readers = {".md": page_faults, ".py": program_faults, ".j2": template_faults}
    faults = [f for p in named for f in readers[p.suffix](p)]
    print("\n".join(map(str, faults)))
    print(f"{len(faults)} faults")


if __name__ == "__main__":
    main()
