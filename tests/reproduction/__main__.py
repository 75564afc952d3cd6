"""``python -m tests.reproduction [-o DIR]``: the papers' tables and figures beside what simulation gives."""

import argparse
import os
import sys

from tests.reproduction.circle import compared
from tests.reproduction.page import write

os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.reproduction")
    parser.add_argument("-o", "--output", default="reproduction")
    arguments = parser.parse_args()
    write(arguments.output, compared(), lambda text: print(text, file=sys.stderr, flush=True))


if __name__ == "__main__":
    main()
