"""``posterior.json``: how things stood when a robot was calibrated, so that a later check tells what has changed.

It holds the posterior mean of everything that moves a reading, and its covariance as a root of few columns: the
directions in which readings of this gauge are least certain (principal components of the readings' Jacobian times the
root). The variance outside these directions is one number. What is set up anew for every session, a bar's zero or a
tracker's frame, is found from the later run itself: nothing that it could take up counts as a change.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.placement import FREEABLE
from planner.common.content_hashes import hand_edits, with_hashes
from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.common.schema import StrictModel, read_json, validate
from planner.common.units import Array, round_significant_digits
from planner.documents.calibrated_robot import MovedBy, describe_moves, effect_parameter
from planner.effects.effect import Parameter
from planner.effects.phi_keys import columns_of, depends_on_run
from planner.fit.noise import Noise, Whitener
from planner.kinematics.bodies import Vector
from planner.kinematics.robot_hash import is_model_of, model_text_hash
from planner.model.model import Model
from planner.release.released_robot import ReleasedRobot
from planner.runs.run import Run, Samples

NAME = "posterior.json"  # beside robot.toml
ANEW_SIZE = 0.02  # [m, rad] of what is set up anew: far more than any reading leaves open of it


class BaselineParameter(StrictModel):
    """A parameter with its value; an effect with all that it moves [m, rad, …]."""

    name: str
    value: float
    moves: tuple[MovedBy, ...] = ()


class BaselineFile(StrictModel):
    """The file.

    Attributes:
        robot_sha256: of the ``robot.toml`` that it belongs to, as in ``expected_error.json``.
        fixtures: names of the places, and where the values of their parameters count from [m].
        points: the same of the tool's points, in the flange frame.
        turns: how probes are turned on the flange (rotation vector) [rad], where the gauge reads orientations.
        noise: of gauge, joints and the gauge's angles, as multiples of what the files declare; ``freedom``: degrees
            behind them.
        parameters: all that moves the reading; ``spread``: root of their covariance, (P, r).
        hashes: of its keys, as it was written; none of files of earlier versions.
        rest: standard deviation of a reading that the root lacks [m]; of an angle as many times its noise.
    """

    schema_: Literal["edbb-posterior/1"] = Field(alias="schema")
    robot: str
    robot_sha256: str
    gauge: str
    fixtures: dict[str, Vector]
    points: dict[str, Vector]
    turns: dict[str, Vector] = {}
    noise: tuple[float, ...] = Field(min_length=2, max_length=3)
    freedom: float
    rest: float
    parameters: tuple[BaselineParameter, ...]
    spread: tuple[tuple[float, ...], ...]
    hashes: dict[str, str] = {}


def _names(cell: Cell, setup: MeasurementSetup) -> tuple[str, str, tuple[str, ...], tuple[str, ...]]:
    """Robot, kind of gauge, fixtures and tool points."""
    places = setup.gauge.lasting_places(setup) or {}
    return cell.robot.name, setup.gauge.kind, tuple(places), tuple(setup.point_names)


def _units(setup: MeasurementSetup) -> Array:
    """What each number of a reading is counted in, (r,): metres, and angles by their noise against a length's."""
    return np.asarray(setup.gauge.sigmas / setup.gauge.sigmas[0])


def baseline_text(released: ReleasedRobot, freedom: float, run: Run, cell: Cell, robot_toml: str) -> str | None:
    """Return the text of the file that goes with ``robot_toml``; ``None`` where the cell lacks fixtures or tool points.

    Args:
        released: with its posterior.
        freedom: degrees of freedom of the fit.
        run, cell: that were identified.
        robot_toml: text of the robot's file.
    """
    digits = 7  # significant ones
    if cell.gauge.lasting_places(setup_of(cell)) is None or not cell.tool.known:
        return None
    fit = released.posterior.fit
    setup, noise = fit.setup, fit.problem.whitener.noise
    kept = [k for k, p in enumerate(fit.model.parameters) if not any(depends_on_run(m.phi.key) for m in p.moves)]
    model = fit.model.subset(kept)
    root, rest = _few_columns(model, fit.solution.root(fit.problem.prior)[kept], run, cell, fit.errors[kept])
    own = set(Model.of(setup, FREEABLE).names)  # what a cell holds for known was found as an effect
    parameters = [
        {"name": p.name, "value": float(round_significant_digits(v, digits))}
        | ({"moves": describe_moves(p, setup)} if p.is_effect and p.name not in own else {})
        for p, v in zip(model.parameters, fit.errors[kept], strict=True)
    ]
    robot, gauge, places, points = _names(cell, setup)
    content = {
        "schema": "edbb-posterior/1",
        "robot": robot,
        "robot_sha256": model_text_hash(robot_toml),
        "gauge": gauge,
        "fixtures": {n: (setup.gauge.lasting_places(setup) or {})[n].tolist() for n in places},
        "points": {n: p.tolist() for n, p in zip(points, setup.p_FM, strict=True)},
        "turns": dict(zip(points, _turns(setup), strict=True)) if setup.gauge.angles else {},
        "noise": [noise.gauge, noise.joints, noise.angle],
        "freedom": freedom,
        "rest": float(round_significant_digits(rest, digits)),
        "parameters": parameters,
        "spread": round_significant_digits(root, digits).tolist(),
    }
    return json.dumps(with_hashes(content), ensure_ascii=False) + "\n"


def joint_noise_of(folder: Path) -> float:
    """Return how much the joints scattered in the runs of a folder, over what is declared; 1 where it has no such file.

    Raises:
        InputError: the file cannot be understood, or was changed by hand.
    """
    path = folder / NAME
    return _read_file(path).noise[1] if path.is_file() else 1.0


def _read_file(path: Path) -> BaselineFile:
    """Read the file as it was written.

    Raises:
        InputError: it cannot be understood, or was changed by hand.
    """
    content = read_json(path)
    file = validate(content, BaselineFile, str(path))
    if edited := hand_edits(path, content):
        raise InputError(f"{edited[0].sentence}; put the file back as it was written, or identify again")
    return file


def _turns(setup: MeasurementSetup) -> list[list[float]]:
    return [r.tolist() for r in Rotation.from_matrix(setup.R_FM).as_rotvec()]


def _few_columns(model: Model, root: Array, run: Run, cell: Cell, errors: Array) -> tuple[Array, float]:
    """Return a root of fewer columns (P, r), and what a reading's uncertainty loses by that [m], rms."""
    probed = 300  # states, and samples of the run, at which readings are looked at
    seen = run.samples.take(even_positions(len(run), probed))
    tall = [_flatten(model.rows(seen, errors) / _units(model.setup)[:, None])]
    plain = [k for k, p in enumerate(model.parameters) if not any(columns_of(m.phi.key) for m in p.moves)]
    for mounting in cell.mountings:
        q = cell.gauge.joint_sampler(cell, mounting, 0)(probed).q
        there = np.zeros((min(probed, len(q)), model.width, len(model.names)))
        there[:, :, plain] = model.subset(plain).rows(Samples.at(q[:probed], mounting), errors[plain])
        tall.append(_flatten(there / _units(model.setup)[:, None]))
    readings = np.concatenate(tall) @ root
    _, size, turn = np.linalg.svd(readings, full_matrices=False)
    lacking = np.sqrt(np.append(np.cumsum(size[::-1] ** 2)[::-1], 0.0) / len(readings))  # without the first k
    # 0.15: times the noise: so much of a reading's uncertainty the directions may lack, rms
    count = int(np.argmax(lacking <= 0.15 * float(np.median(model.noise(seen)))))
    return np.asarray(root @ turn[:count].T), float(lacking[count])


def _flatten(rows: Array) -> Array:
    """Put the numbers of each reading one under the other, (n, r, P) to (n r, P)."""
    return np.asarray(rows.reshape(-1, rows.shape[2]))


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
                f"{path} is missing: a baseline is the folder that 'edbb identify' writes. The cell must give the tool "
                "point (and a bar's fixtures), and the posterior must have converged. Identify the run again"
            )
        file = _read_file(path)
        if not is_model_of(folder / "robot.toml", file.robot_sha256):
            raise InputError(f"{path} belongs to another robot.toml: one of the two was changed; identify again")
        return cls.of(file, cell, str(path))

    @classmethod
    def of(cls, file: BaselineFile, cell: Cell, where: str) -> "Baseline":
        """Build the model that a file describes; ``where`` names it in messages.

        Raises:
            InputError: it does not belong to the cell.
        """
        setup = replace(setup_of(cell), gauge=cell.gauge.with_turns(bool(file.turns)))
        said = (file.robot, file.gauge, tuple(file.fixtures), tuple(file.points))
        found = _names(cell, setup)
        for what, a, b in zip(("robot", "gauge", "fixtures", "tool points"), said, found, strict=True):
            if a != b:
                raise InputError(f"{where}: the {what} of the baseline: {a}; of {cell.path}: {b}: take its own cell")
        setup = setup.gauge.place_nominally(replace(setup, p_FM=np.array(list(file.points.values()))), cell)
        if file.fixtures:
            setup = replace(setup, p_BX=np.array(list(file.fixtures.values())))
        if file.turns:
            setup = replace(setup, R_FM=Rotation.from_rotvec(list(file.turns.values())).as_matrix())
        try:
            return cls.build(file, setup)
        except (KeyError, ValueError) as err:
            raise InputError(f"{where}: {cell.robot.name} has no {err}") from err

    @classmethod
    def build(cls, file: BaselineFile, setup: MeasurementSetup) -> "Baseline":
        """Build the model in a set-up; what is set up anew comes last and is not known yet."""
        own = {p.name: p for p in Model.of(setup, FREEABLE).parameters}
        anew = [p for p in own.values() if _is_anew(p, setup)]
        lasts = [bool(p.moves) or not p.name.startswith(setup.gauge.set_anew) for p in file.parameters]
        known = [p for p, there in zip(file.parameters, lasts, strict=True) if there]
        parameters = (*(effect_parameter(p.name, p.moves, setup) if p.moves else own[p.name] for p in known), *anew)
        values = np.append([p.value for p in known], np.zeros(len(anew)))
        root = np.array(file.spread).reshape(len(file.parameters), -1)[lasts]
        return cls(file, Model(setup, parameters), values, np.vstack([root, np.zeros((len(anew), root.shape[1]))]))

    def adapt_to_session(self, cell: Cell, run: Run) -> "Baseline":
        """Return the baseline for the run of a later session, with the gauge where that run finds it.

        Raises:
            InputError, NoSolutionError: the run cannot tell where the gauge stands.
        """
        there = self.build(self.file, self.model.setup.gauge.set_up_again(self.model.setup, cell, run))
        there = there.restrict_to_samples(run.samples)
        which = there._session_positions
        white = block_diag(*np.linalg.inv(np.linalg.cholesky(there.noise_covariance(run.samples))))
        # 4: Gauss-Newton steps in which what was set up anew is found, from where it was placed by the run
        for _ in range(4):
            rows, off = there.anew_rows(run.samples), there.difference(run)
            values = there.values.copy()
            values[which] += np.linalg.lstsq(white @ rows, white @ off)[0] * ANEW_SIZE
            there = replace(there, values=values)
        return there

    @property
    def _session_positions(self) -> np.ndarray:
        """Positions of the parameters of what is set up anew for every session."""
        return np.array([_is_anew(p, self.model.setup) for p in self.model.parameters]).nonzero()[0]

    def restrict_to_samples(self, samples: Samples) -> "Baseline":
        """Return the baseline without effects of quantities that the samples lack; the model stays the same."""
        have = [
            all(getattr(samples, c) is not None for m in p.moves for c in columns_of(m.phi.key))
            for p in self.model.parameters
        ]
        kept = [k for k, there in enumerate(have) if there]
        return replace(self, model=self.model.subset(kept), values=self.values[kept], root=self.root[kept])

    def difference(self, run: Run) -> Array:
        """Return readings less their expectation, the numbers of each one after the other, (n r,) [m, rad]."""
        targets = self.model.setup.targets(run.samples, run.readings)
        return self.model.residual(run.samples, targets, self.values).ravel()

    def rows(self, samples: Samples, extra: Sequence[Parameter] = ()) -> Array:
        """Return the derivative of all numbers by every parameter and by ``extra``, (n r, P + E)."""
        wider = self.model.plus(list(extra))
        return _flatten(wider.rows(samples, np.append(self.values, np.zeros(len(extra)))))

    def anew_rows(self, samples: Samples) -> Array:
        """Return what ``ANEW_SIZE`` of all that is set up anew does to the numbers, (n r, a) [m, rad]."""
        return np.asarray(self.rows(samples)[:, self._session_positions] * ANEW_SIZE)

    def covariance(self, samples: Samples) -> Array:
        """Covariance of readings less their expectation where nothing has changed, (n r, n r) [m², m rad, rad²].

        What is set up anew for every session adds nothing: it is found from the readings themselves.
        """
        known = self.rows(samples) @ self.root
        return np.asarray(block_diag(*self.noise_covariance(samples)) + known @ known.T)

    def noise_covariance(self, samples: Samples) -> Array:
        """Covariance of each reading by gauge, repeatability and what the root lacks, (n, r, r) [m², m rad, rad²]."""
        white = Whitener.of(self.model, samples, Noise(*self.file.noise))
        return white.covariance() + self.file.rest**2 * np.diag(_units(self.model.setup) ** 2)


def _is_anew(p: Parameter, setup: MeasurementSetup) -> bool:
    return p.group == "gauge" and p.name.startswith(setup.gauge.set_anew)
