"""What every fit of a run shares, and how a tracer is called."""

from collections.abc import Callable
from dataclasses import dataclass

from planner.identification.fit import Fit
from planner.identification.splits import Split
from planner.identification.stages import Fitted, fitted
from planner.identification.types import Metrics, Traced
from planner.model import Model
from planner.run import Run

Say = Callable[[str], None]


@dataclass(frozen=True)
class Bench:
    """What every fit of a run needs: run, split, judge of the validation run, and whether outliers are turned down."""

    run: Run
    split: Split
    judge: Callable[[Fit], Metrics | None]
    robust: bool

    def spare(self, model: Model) -> int:
        """Number of readings beyond the parameters of a model."""
        return len(self.run) * model.width - len(model.parameters)

    def fitted(self, name: str, model: Model, before: Fit | None = None, whole: bool = False) -> Fitted:
        """Fit a model to the run, from where the fit ``before`` came to rest."""
        return fitted(name, model, self.run, self.split, self.judge, self.robust, before, whole)


Tracer = Callable[[Fitted, Bench, Say], tuple[list[Fitted], Traced]]
"""From the fitted geometry, with what the cell declares beside it, to one stage for each effect, and what was found."""
