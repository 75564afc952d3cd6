"""``posterior.json``: how things stood when a robot was calibrated, so that a later check tells what has changed.

It holds the posterior mean of everything that moves a bar's reading, and what is not known of it: the covariance as a
root of few columns, those directions in which the readings of this gauge are least sure (principal components of
reading times root). What these lack stands as one number.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup, setup_of
from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.common.reading import read_bytes
from planner.common.schema import StrictModel, read_json, validate
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.parameters import Parameter, ParameterMove
from planner.effects.phi_keys import columns_of, depends_on_run, phi_from_key
from planner.identification.noise import Noise, Whitener
from planner.identification.released_robot import ReleasedRobot
from planner.kinematics.bodies import Vector
from planner.model.model import Model
from planner.runs.run import Run, Samples

NAME = "posterior.json"  # beside robot.toml
PROBED = 300  # states, and samples of the run, at which readings are looked at
LEFT_OUT = 0.2  # times the noise: so much of a reading's uncertainty the directions may lack, rms
DIGITS = 7  # significant ones
EVERYTHING = frozenset({"fixture", "tool", "zero"})
OWN_GROUPS = ("gauge", "geometry")  # whose parameters are known by their names


class Mover(StrictModel):
    """A number of the reading, or a transform by its name, and the basis function that it follows."""

    on: str
    phi: str


class BaselineParameter(StrictModel):
    """A parameter with its value; an effect with all that it moves [m, rad, …]."""

    name: str
    value: float
    moves: tuple[Mover, ...] = ()


class BaselineFile(StrictModel):
    """The file.

    Attributes:
        robot_sha256: of the ``robot.toml`` that it belongs to.
        fixtures: names of the places, and where the values of their parameters count from [m].
        points: the same of the tool's points, in the flange frame.
        noise: of gauge and joints, as multiples of what the files declare; ``freedom``: degrees behind them.
        parameters: all that moves the reading; ``spread``: root of their covariance, (P, r).
        rest: standard deviation of a reading that the root lacks [m].
    """

    schema_: Literal["edbb-posterior/1"] = Field(alias="schema")
    robot: str
    robot_sha256: str
    gauge: str
    fixtures: dict[str, Vector]
    points: dict[str, Vector]
    noise: tuple[float, float]
    freedom: float
    rest: float
    parameters: tuple[BaselineParameter, ...]
    spread: tuple[tuple[float, ...], ...]


def _names(cell: Cell, setup: MeasurementSetup) -> tuple[str, str, tuple[str, ...], tuple[str, ...]]:
    """Robot, kind of gauge, fixtures and tool points."""
    return cell.robot.name, cell.gauge.kind, tuple(setup.place_names), tuple(setup.point_names)


def baseline_text(released: ReleasedRobot, freedom: float, run: Run, cell: Cell, robot_toml: str) -> str | None:
    """Return the text of the file that goes with ``robot_toml``; ``None`` where the gauge is no bar at given fixtures.

    Args:
        released: with its posterior.
        freedom: degrees of freedom of the fit.
        run, cell: that were identified.
        robot_toml: text of the robot's file.
    """
    if run.readings.length is None or not cell.fixtures or not cell.tool.known:
        return None
    fit = released.posterior.fit
    setup, noise = fit.model.setup, fit.problem.whitener.noise
    kept = [k for k, p in enumerate(fit.model.parameters) if not any(depends_on_run(m.phi.key) for m in p.moves)]
    model = fit.model.subset(kept)
    root, rest = _few_columns(model, fit.solution.root(fit.problem.prior)[kept], run, cell, fit.errors[kept])
    parameters = [
        {"name": p.name, "value": float(_few_digits(v))}
        | ({} if p.group in OWN_GROUPS else {"moves": _movers(p, setup)})
        for p, v in zip(model.parameters, fit.errors[kept], strict=True)
    ]
    robot, gauge, places, points = _names(cell, setup)
    content = {
        "schema": "edbb-posterior/1",
        "robot": robot,
        "robot_sha256": sha256(robot_toml.encode()).hexdigest(),
        "gauge": gauge,
        "fixtures": {n: p.tolist() for n, p in zip(places, setup.p_BX, strict=True)},
        "points": {n: p.tolist() for n, p in zip(points, setup.p_FM, strict=True)},
        "noise": [noise.gauge, noise.joints],
        "freedom": freedom,
        "rest": float(_few_digits(rest)),
        "parameters": parameters,
        "spread": _few_digits(root).tolist(),
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False) + "\n"


def _movers(p: Parameter, setup: MeasurementSetup) -> list[dict[str, str]]:
    named = ((f"reading {m.index}" if m.on == "reading" else setup.chain.transforms[m.index].name, m) for m in p.moves)
    return [{"on": on, "phi": m.phi.key} for on, m in named]


def _few_columns(model: Model, root: Array, run: Run, cell: Cell, errors: Array) -> tuple[Array, float]:
    """Return a root of fewer columns (P, r), and what a reading's uncertainty loses by that [m], rms."""
    seen = run.samples.take(even_positions(len(run), PROBED))
    tall = [model.rows(seen, errors)[:, 0]]
    plain = [k for k, p in enumerate(model.parameters) if not any(columns_of(m.phi.key) for m in p.moves)]
    for mounting in cell.mountings:
        q = cell.gauge.joint_sampler(cell, mounting, 0)(PROBED).q
        there = np.zeros((min(PROBED, len(q)), len(model.names)))
        there[:, plain] = model.subset(plain).rows(Samples.at(q[:PROBED], mounting), errors[plain])[:, 0]
        tall.append(there)
    readings = np.concatenate(tall) @ root
    _, size, turn = np.linalg.svd(readings, full_matrices=False)
    lacking = np.sqrt(np.append(np.cumsum(size[::-1] ** 2)[::-1], 0.0) / len(readings))  # without the first k
    count = int(np.argmax(lacking <= LEFT_OUT * float(np.median(model.noise(seen)))))
    return np.asarray(root @ turn[:count].T), float(lacking[count])


def _few_digits(values: Array | float) -> Array:
    return np.asarray(np.vectorize(lambda v: float(f"{v:.{DIGITS}g}") + 0.0, otypes=[float])(values))


@dataclass(frozen=True)
class Baseline:
    """How things stood at a calibration: a model of the readings, with values, and what is not known of them.

    Attributes:
        file: what was read.
        model: measurement model with every parameter of the file, in its order.
        values: of the parameters, (P,) [m, rad, …]; root: of their covariance, (P, r).
    """

    file: BaselineFile
    model: Model
    values: Array
    root: Array

    @classmethod
    def read(cls, folder: Path, cell: Cell) -> "Baseline":
        """Read the file in the folder of an identification; ``cell`` is the nominal one that was calibrated.

        Raises:
            InputError: there is no such file, or it belongs to another robot, gauge or cell.
        """
        path = folder / NAME
        if not path.is_file():
            raise InputError(
                f"{path} is missing: a baseline is the folder that 'edbb identify' writes for a bar between fixtures "
                "that the cell gives, where the posterior came to rest; identify the run again"
            )
        file = validate(read_json(path), BaselineFile, str(path))
        if file.robot_sha256 != sha256(read_bytes(folder / "robot.toml")).hexdigest():
            raise InputError(f"{path} belongs to another robot.toml: one of the two was changed; identify again")
        return cls.of(file, cell, str(path))

    @classmethod
    def of(cls, file: BaselineFile, cell: Cell, where: str) -> "Baseline":
        """Build the model that a file describes; ``where`` names it in messages.

        Raises:
            InputError: it does not belong to the cell.
        """
        setup = setup_of(cell)
        said = (file.robot, file.gauge, tuple(file.fixtures), tuple(file.points))
        found = _names(cell, setup)
        for what, a, b in zip(("robot", "gauge", "fixtures", "tool points"), said, found, strict=True):
            if a != b:
                raise InputError(f"{where}: the {what} of the baseline: {a}; of {cell.path}: {b}: take its own cell")
        setup = replace(setup, p_BX=np.array(list(file.fixtures.values())), p_FM=np.array(list(file.points.values())))
        own = {p.name: p for p in Model.of(setup, EVERYTHING).parameters}
        try:
            parameters = tuple(own[p.name] if not p.moves else _parameter(p, setup) for p in file.parameters)
        except (KeyError, ValueError) as err:
            raise InputError(f"{where}: {cell.robot.name} has no {err}") from err
        root = np.array(file.spread).reshape(len(parameters), -1)
        return cls(file, Model(setup, parameters), np.array([p.value for p in file.parameters]), root)

    def for_samples(self, samples: Samples) -> "Baseline":
        """Return it without effects of quantities that were not logged; the model is the same."""
        have = [
            all(getattr(samples, c) is not None for m in p.moves for c in columns_of(m.phi.key))
            for p in self.model.parameters
        ]
        kept = [k for k, there in enumerate(have) if there]
        return replace(self, model=self.model.subset(kept), values=self.values[kept], root=self.root[kept])

    def reading(self, samples: Samples) -> Array:
        """Return the bar's expected length, (n,) [m]."""
        return self.model.reading(samples, self.values)[:, 0]

    def rows(self, samples: Samples, extra: Sequence[Parameter] = ()) -> Array:
        """Return the reading's derivative by every parameter and by ``extra``, (n, P + E)."""
        wider = self.model.plus(list(extra))
        return wider.rows(samples, np.append(self.values, np.zeros(len(extra))))[:, 0]

    def covariance(self, samples: Samples, zero_known: bool = False) -> Array:
        """Covariance of readings less their expectation where nothing has changed, (n, n) [m²].

        The bar's zero is set anew in every session; ``zero_known`` leaves it out.
        """
        rows = self.rows(samples)
        zeros = [k for k, p in enumerate(self.model.parameters) if p.group == "gauge" and p.name.startswith("zero")]
        root = self.root.copy()
        root[zeros] = 0.0
        known, anew = rows @ root, rows[:, zeros] * (0.0 if zero_known else self.model.prior[zeros])
        return np.asarray(np.diag(self.noise_variance(samples)) + known @ known.T + anew @ anew.T)

    def noise_variance(self, samples: Samples) -> Array:
        """Variance of a reading by gauge, repeatability and what the root lacks, (n,) [m²]."""
        white = Whitener.of(self.model, samples, Noise(*self.file.noise))
        return white.covariance(slice(None))[:, 0, 0] + self.file.rest**2


def _parameter(p: BaselineParameter, setup: MeasurementSetup) -> Parameter:
    return Parameter(p.name, "1", 1.0, p.name, tuple(_moves(p, setup)), "effect")


def _moves(p: BaselineParameter, setup: MeasurementSetup) -> Iterator[ParameterMove]:
    for m in p.moves:
        phi: BasisFunction = phi_from_key(m.phi, setup.robot.n_joints)
        word, _, number = m.on.partition(" ")
        if word == "reading":
            yield ParameterMove("reading", int(number), phi)
        else:
            yield ParameterMove("transform", setup.chain.index(m.on), phi)
