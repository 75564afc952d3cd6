"""``python -m tests.reproduction [-o DIR] [--plans]``: the papers' tables and figures beside what simulation gives."""

import argparse
import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")

from tests.reproduction.page import write


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.reproduction")
    parser.add_argument("-o", "--output", default="reproduction")
    parser.add_argument("--plans", action="store_true", help="plan the circle and the path of section 4.1 as well")
    arguments = parser.parse_args()
    circle = None
    if arguments.plans:
        from tests.reproduction.circle import compared

        circle = compared()
    write(arguments.output, circle, lambda text: print(text, file=sys.stderr, flush=True))


if __name__ == "__main__":
    main()
