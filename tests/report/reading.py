"""Reads the page back as a browser's parser does: what it loads, its scripts, its tables."""

from html.parser import HTMLParser

LOADS = ("src", "href", "data", "poster", "srcset", "action")


class ReadPage(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.loads: list[str] = []
        self.ids: set[str] = set()
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.tables: list[list[list[str]]] = []
        self.styles = self.text = ""
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [value or "" for name, value in attrs if name in LOADS]
        self.ids |= {value or "" for name, value in attrs if name == "id"}
        if tag == "script":
            self.scripts.append((dict(attrs), ""))
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag in ("script", "style", "td", "th"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self._open and self._open[-1] == tag:
            self._open.pop()

    def handle_data(self, data: str) -> None:
        inside = self._open[-1] if self._open else ""
        data = data if inside == "script" else data.replace("\u00a0", " ")  # a line may not break there
        if inside == "script":
            attributes, text = self.scripts[-1]
            self.scripts[-1] = (attributes, text + data)
        elif inside == "style":
            self.styles += data
        else:
            self.text += data
            if inside:
                self.tables[-1][-1][-1] += data

    def table(self, first: str) -> list[list[str]]:
        """Rows of the table whose head begins with ``first``, without the head."""
        return next(t[1:] for t in self.tables if t[0][0] == first)
