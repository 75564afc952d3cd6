"""Study from which place of the fixture a bar shows most, before anything is put up."""

import sys

from planner import study


def main(folder: str = "fixture_place", cell: str = "comau-nj130/edbb") -> None:
    found = study(cell, seed=1)
    print(found.summary())
    found.write(folder)
    found.plot_fixture_map().save(f"{folder}/places.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
