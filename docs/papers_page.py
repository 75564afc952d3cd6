"""``python -m docs.papers_page [DIR]``: writes ``docs/papers.md``; the numbers are those that ``edbb papers`` wrote."""

import argparse
import shutil
from pathlib import Path

from planner.reproduction.papers_result import page_markdown
from planner.reproduction.rows import STORED, stored_numbers

PAGE = Path(__file__).with_name("papers.md")


def main() -> None:
    """Keep the numbers of a folder, where one is named, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m docs.papers_page")
    parser.add_argument("folder", nargs="?", type=Path)
    asked = parser.parse_args()
    if asked.folder:
        shutil.copyfile(asked.folder / "numbers.json", STORED)
    PAGE.write_text(page_markdown(stored_numbers()), encoding="utf-8")


if __name__ == "__main__":
    main()
