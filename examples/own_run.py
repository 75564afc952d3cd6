"""Identify an arm from a run of your own: here one measured with a tracker."""

import sys
from pathlib import Path

from planner import identify, load_run

HERE = Path(__file__).parent


def main(folder: str = "own_run") -> None:
    run = load_run(HERE / "measured_run.csv")
    print(f"{run.name}: {len(run)} poses")
    found = identify(run, cell=HERE / "measured_run.toml", no_trace=True)
    print(found.summary())
    for estimate in found.calibration.estimates[:5]:
        print(f"{estimate.name}: {estimate.value:.3g} ± {estimate.std or 0:.2g} {estimate.unit}")
    found.plot_residuals().save(found.write(folder)[0].parent / "errors.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
