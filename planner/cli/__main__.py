"""``python -m planner.cli`` is the command ``edbb``."""

from planner.cli.app import main

if __name__ == "__main__":
    main()
