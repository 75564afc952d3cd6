"""Links the first use of each word of the glossary on a page to its sentence there."""

import re
from pathlib import Path
from typing import Any

GLOSSARY = Path(__file__).with_name("glossary.md")
ROW = re.compile(r'^\| <a id="([^"]+)"></a>([^|]+?) \|', re.MULTILINE)
KEPT = re.compile(  # left as it is: fences, headings, rows of tables, HTML, inline code, links
    r"^```.*?^```|^#.*?$|^\|.*?$|^:::.*?$|<[^>]*>|`[^`]*`|!?\[[^\]]*\]\([^)]*\)", re.MULTILINE | re.DOTALL
)
NOT_LINKED = (
    "cause", "cell", "effect", "gauge", "index", "model", "parameter", "place", "plan", "pose", "prior",
    "record", "run", "segment", "session", "zero",
)  # fmt: skip
"""Words of every day: on most pages they mean what everybody means, not what the glossary says."""


def terms() -> dict[str, str]:
    """Return the anchor of every word, the longest words first."""
    found = {}
    for anchor, name in ROW.findall(GLOSSARY.read_text(encoding="utf-8")):
        for word in name.split(" (")[0].split(", "):
            found[word] = anchor
    return dict(sorted(found.items(), key=lambda item: -len(item[0])))


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    """Link the words of a page, but for the glossary itself."""
    here = page.file.src_uri
    if here == GLOSSARY.name:
        return markdown
    return link_terms(markdown, "../" * here.count("/") + GLOSSARY.name)


def link_terms(markdown: str, glossary: str) -> str:
    """Return the page with the first use of each word, in running text, as a link to ``glossary``."""
    left = {word: anchor for word, anchor in terms().items() if word not in NOT_LINKED}

    def linked(text: str) -> str:
        if not left:
            return text
        words = re.compile(rf"\b({'|'.join(map(re.escape, left))})(?=s?\b)")

        def link(found: re.Match[str]) -> str:
            anchor = left.pop(found[1], None)
            return found[1] if anchor is None else f"[{found[1]}]({glossary}#{anchor})"

        return words.sub(link, text)

    out, at = [], 0
    for kept in KEPT.finditer(markdown):
        out += [linked(markdown[at : kept.start()]), kept[0]]
        at = kept.end()
    return "".join([*out, linked(markdown[at:])])
