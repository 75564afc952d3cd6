"""What a calibration hands to whoever computes with it: draws, covariance, likelihood, left-out samples, ArviZ."""

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.common.determinism import on_one_thread
from planner.common.errors import MissingProgramError
from planner.common.lazy_modules import pl
from planner.common.units import Array, to_deg, to_mm
from planner.documents.calibration import Calibration
from planner.fit.influence import Influence

if TYPE_CHECKING:
    import polars


class FitAccess:
    """Numbers of a fit, in SI units, in the order of :attr:`names`; the base of the result of ``identify``."""

    calibration: Calibration

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, (P,)."""
        return self.calibration.fit.model.names

    @property
    def units(self) -> tuple[str, ...]:
        """Their units, of the SI, (P,)."""
        return tuple(p.unit for p in self.calibration.fit.model.parameters)

    @property
    def values(self) -> Array:
        """Values of the fitted parameters, (P,)."""
        return self.calibration.fit.errors

    @property
    def covariance(self) -> Array:
        """Covariance of the fitted parameters by noise and priors, (P, P).

        Example:
            >>> sigma = np.sqrt(np.diag(found.covariance))  # doctest: +SKIP
        """
        return self.influence.covariance

    @property
    def log_likelihood(self) -> float:
        """Natural logarithm of the density of all readings by the fit, with the noise that it found."""
        return self.influence.log_likelihood

    @cached_property
    def influence(self) -> Influence:
        """Leverage, left-out residuals, changes of the parameters and Cook's distance of every sample (arrays).

        Example:
            >>> found.influence.leverage.sum()  # parameters that the readings decide  # doctest: +SKIP
        """
        return Influence.of(self.calibration.fit)

    @cached_property
    def draws(self) -> Mapping[str, Array]:
        """Parameters drawn from the posterior, (n,) each, by name; from the fit's Gaussian where none was computed.

        Example:
            >>> np.quantile(found.draws["theta2"], [0.025, 0.975])  # rad  # doctest: +SKIP
        """
        released = self.calibration.released
        if released is not None:
            known = released.posterior
            return dict(zip(known.fit.model.names, known.drawn, strict=True))
        return dict(zip(self.names, self._gaussian_draws(), strict=True))

    @on_one_thread
    def _gaussian_draws(self) -> Array:
        fit = self.calibration.fit
        # 1000: draws of a fit whose robot was not released by the posterior
        z = np.random.default_rng(0).standard_normal((len(fit.errors), 1000))
        return np.asarray(fit.errors[:, None] + fit.solution.root(fit.problem.prior) @ z)

    def leave_one_out(self) -> "polars.DataFrame":
        """Return one row a sample: its residual, that of the fit without it, sigma, leverage, distance, log density.

        Columns of readings are in mm, or in degrees where the gauge reads angles; several have the numbers behind.

        Example:
            >>> found.leave_one_out().sort("distance")  # doctest: +SKIP
        """
        known, run = self.influence, self.calibration.run
        angle = self.calibration.fit.model.setup.gauge.unit != "mm"
        unit, shown = ("deg", to_deg) if angle else ("mm", to_mm)
        columns: dict[str, Any] = {"sample": np.arange(len(run))}
        if run.samples.pose is not None:
            columns["pose"] = run.samples.pose
        groups = (("residual", known.residual), ("left_out", known.left_out_residual), ("sigma", known.left_out_std))
        for name, values in groups:
            width = values.shape[1]
            columns |= {
                f"{name}{k + 1 if width > 1 else ''}_{unit}": np.asarray(shown(values[:, k])) for k in range(width)
            }
        columns |= {"leverage": known.leverage, "distance": known.distance, "log_density": known.log_density}
        return pl.DataFrame(columns)

    def to_arviz(self) -> Any:
        """Return the draws as ``InferenceData`` of ArviZ, one chain, with the residuals as observed data.

        Raises:
            MissingProgramError: ArviZ is not installed.

        Example:
            >>> arviz.plot_forest(found.to_arviz())  # doctest: +SKIP
        """
        try:
            import arviz
        except ImportError as err:
            raise MissingProgramError("to_arviz() needs ArviZ: pip install arviz; draws holds the same arrays") from err
        posterior = {name: np.asarray(values)[None, :] for name, values in self.draws.items()}
        observed = {"residual": self.influence.residual}
        made: Any = arviz.from_dict
        if int(arviz.__version__.partition(".")[0]) < 1:
            return made(posterior=posterior, observed_data=observed)
        return made({"posterior": posterior, "observed_data": observed})
