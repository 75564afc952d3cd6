"""A gauge answers for itself: few places outside its rooms may ask which one it is."""

import re
from pathlib import Path

import planner

MOST = 15
ASKED = re.compile(
    r"gauge\.(head|kind)\b|\.(is_attached|frees_base|is_loaded|can_be_loaded)\b|isinstance\([^)]*[gG]auge\b"
)
OWN = ("gauges/", "cell/gauge", "cell/file.py", "centring/")  # its rooms; and what has a file's section


def test_few_places_ask_which_gauge_it_is():
    root = Path(planner.__file__).parent
    found = [
        f"{path.relative_to(root)}: {line.strip()}"
        for path in sorted(root.rglob("*.py"))
        if not str(path.relative_to(root)).startswith(OWN)
        for line in path.read_text().splitlines()
        if ASKED.search(re.sub(r"\"[^\"]*\"", "", line))
    ]
    assert len(found) <= MOST, "\n".join(found)
