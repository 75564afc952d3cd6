"""What may still be wrong with a robot that was calibrated, and what further readings would leave of it.

What is known of the robot is the covariance in ``expected_error.json``: of all causes that may act, with the sizes that
the runs so far say, averaged over the rivals that they leave. Where gauge and fixtures stand counts as set up anew, so
that the gauge may be another one, unless the cell says that they were left standing. What no column of that covariance
holds, the discrepancy among it, stays.

Where the error of the tool counts: in a box of the workspace, or at the targets of a program that will be driven.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from scipy.linalg import block_diag

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.placement import FREEABLE
from planner.cell.region_file import states_in_region
from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.common.units import Array, from_mm, to_mm
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from planner.design.expected_errors import EVERYWHERE, square_error_limit
from planner.documents.baseline import joint_noise_of
from planner.documents.calibrated_robot import CalibratedRobot, effect_parameter
from planner.documents.expected_error import ExpectedError, StandingGauge
from planner.effects.effect import Parameter, tool_point_parameters
from planner.effects.sizes import UNKNOWN_PRIOR
from planner.inference.posterior_background import acts_on_robot, background_families
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Identification
from planner.model.model import Model
from planner.model.tool_error import WORKSPACE_STATES, uniform_states
from planner.runs.run import Samples


@dataclass(frozen=True)
class ErrorPlaces:
    """Joint states at which the error counts, and the tool's points there.

    Attributes:
        words: where that is, as the end of a sentence says it.
        q: states, (n, N) [rad].
        p_FM: tool point of each in the flange, (n, 3) [m]; ``None``: the measured one.
    """

    words: str
    q: Array
    p_FM: Array | None = None


def places_in_region(path: Path, cell: Cell) -> ErrorPlaces:
    """Return the states in which the measured tool point is in the box of a file.

    Raises:
        InputError: as of ``states_in_region``.
    """
    # 10: times as many states as are kept, of which a box holds a part
    inside = states_in_region(path, cell, uniform_states(cell, 10 * WORKSPACE_STATES, 0))
    return ErrorPlaces(f"in {path.name}", inside[:WORKSPACE_STATES])


def places_of_program(path: Path, robot_file: Path) -> ErrorPlaces:
    """Return the targets of a program with their tools, as ``edbb compensate`` reads them for a calibrated robot.

    Of targets that are joint angles the tool is the measured one.

    Raises:
        InputError: the program is not understood, or none of its targets is certain.
    """
    robot = load_robot(robot_file)
    own = robot.tool_points[0].p_FM if len(robot.tool_points) == 1 else np.zeros(3)
    done = compensate_file(path, robot.nominal_robot, CalibratedRobot(robot), frames=ToolAndBase(p_FM=own))
    few = even_positions(len(done.q), WORKSPACE_STATES)
    tools = [done.targets[k].pose for k in few]
    p_FM = np.array([own if pose is None else pose.T_FT[:3, 3] for pose in tools])
    return ErrorPlaces(f"at the targets of {path.name}", done.q[few], p_FM)


ROBOT, IDENTIFICATION = "robot.toml", "identification.json"


@dataclass(frozen=True)
class CalibratedState:
    """What a folder that ``edbb identify`` wrote says of a robot.

    Attributes:
        folder: the folder.
        known: covariance of what moves the tool.
        stated: error of the tool over the workspace [m] that is as likely exceeded as not; at_most: what it stays below
            with a probability of 95 %.
        rest: how much the joints scattered in the runs so far, over what the robot's file declares.
    """

    folder: Path
    known: ExpectedError
    stated: float
    at_most: float
    rest: float = 1.0

    @classmethod
    def read(cls, folder: Path, cell: Cell) -> "CalibratedState":
        """Read the folder of an identification of the cell's robot.

        Raises:
            InputError: no such folder, another robot, or nothing is known of the robot's error.
        """
        has_document = (folder / IDENTIFICATION).is_file()
        document = Identification.read_usable(folder / IDENTIFICATION) if has_document else None
        if document is None or not (folder / ROBOT).is_file():
            lacking = ROBOT if has_document else IDENTIFICATION
            raise InputError(f"{folder}: --after takes the folder that 'edbb identify' wrote; it has no {lacking}")
        if document.robot != cell.robot.name:
            other = f"calibrates the robot '{document.robot}', but the cell's is '{cell.robot.name}'"
            raise InputError(f"{folder}: {other}")
        if document.release is None:
            raise InputError(f"{folder / IDENTIFICATION}: no robot was released: there is no error to be lowered")
        known = ExpectedError.read(cell.robot, folder / ROBOT)
        if isinstance(known, str):
            raise InputError(f"{folder}: {known}; --after needs it: identify the run again")
        stated = float(from_mm(np.sqrt(sum(v**2 for v in known.file.parts_mm.values()))))
        return cls(folder, known, stated, document.release.at_most, joint_noise_of(folder))


@dataclass(frozen=True)
class RemainingErrors:
    """What may still be wrong with a calibrated robot, and where the gauge stands; see :class:`ExpectedErrors`.

    Attributes:
        state_before: what the runs so far say.
        model: of all that moves the reading.
        root: root of the covariance of its parameters, (P, r).
        of_gauge: which columns of the root only say where the gauge stands, (r,) bool.
        weight_per_prior: mean square error of the tool per squared columns, (r, r) [m²], where it counts.
        whole_weight: the same over the whole workspace, for which the error is stated.
        where: where it counts, as the end of a sentence says it.
        stands: where the gauge stands, if it was left standing.
    """

    before: CalibratedState
    model: Model
    root: Array
    of_gauge: np.ndarray
    weight_per_prior: Array
    whole_weight: Array
    where: str = EVERYWHERE
    stands: StandingGauge | None = None

    untraced_label: ClassVar[str] = "before this session"
    before_label: ClassVar[str] = "as stated by the runs so far"
    condition: ClassVar[str] = ""
    doubt: ClassVar[float] = 0.0  # the runs so far have taught the sizes

    @classmethod
    def of(
        cls, before: CalibratedState, cell: Cell, samples: Samples, counts: ErrorPlaces | None = None
    ) -> "RemainingErrors":
        """Return the errors that poses like ``samples`` of the cell's gauge can reduce; ``counts``: where errors count.

        Raises:
            InputError: an effect moves a part that the cell's robot does not have.
        """
        setup, known = setup_of(cell), before.known
        tool = dict(zip(tool_point_parameters(""), tool_names(setup), strict=True))  # of a lone point that was measured
        names = [tool.get(p.name, p.name) for p in known.file.parameters]
        own = {p.name: p for p in Model.of(setup, FREEABLE).parameters}
        effects = [effect_parameter(p.name, p.moves, setup) for p in known.file.parameters if p.moves]
        stands = standing_gauge(cell, known)
        standing = [] if stands is None else [n for n in stands.parameters if n in own]
        anew = [p for n, p in own.items() if n not in (*names, *standing) and p.group != "geometry"]
        anew += _gauge_errors(setup, samples)
        robot = {p.name: p for p in (*own.values(), *effects) if p.name in names}
        kept = [k for k, n in enumerate(names) if n in robot]
        model = Model(setup, (*(robot[names[k]] for k in kept), *(own[n] for n in standing), *anew))
        spread = known.spread if stands is None else known.spread_with_gauge
        rows = [*kept, *(len(names) + k for k, n in enumerate(stands.parameters if stands else ()) if n in own)]
        sizes = np.array([p.prior if np.isfinite(p.prior) else UNKNOWN_PRIOR for p in anew])
        root = block_diag(spread[rows], np.diag(sizes))
        everywhere = ErrorPlaces(EVERYWHERE, uniform_states(cell, WORKSPACE_STATES, 0))
        of_robot = spread[: len(names)]
        whole = weight = _tool_weight(known, everywhere, of_robot, len(anew))
        if counts is not None:
            weight = _tool_weight(known, counts, of_robot, len(anew))
        where = (counts or everywhere).words
        gauge = np.arange(root.shape[1]) >= spread.shape[1]
        return cls(before, model, root, gauge, weight, whole, where, stands)

    @property
    def usual(self) -> np.ndarray:
        """No family (r,): the runs so far have taught the sizes."""
        return np.full(self.root.shape[1], -1)

    @property
    def untraced_error(self) -> float:
        """Error of the tool [m] before the session, where it counts."""
        return self.state(float(np.trace(self.weight_per_prior)))

    @property
    def assumptions(self) -> str:
        """The assumption behind the expected errors, as a sentence."""
        return f"what {self.before.folder.name}/{IDENTIFICATION} says of the robot holds, sizes of effects included"

    def on(self, model: Model) -> Self:
        """Return the same errors in another model of the same parameters."""
        return replace(self, model=model)

    def white(self, samples: Samples) -> Array:
        """Return the change of the readings by each column of the root, in their standard deviations, (n, r).

        The arm comes to rest as it did in the runs so far, whatever its maker promises.
        """
        noise = self.model.reading_noise(samples)
        noise = replace(noise, joint_sigma=noise.joint_sigma * self.before.rest)
        return np.asarray(self.model.rows(samples)[:, 0] @ self.root / noise.std[:, None])

    def state(self, square: float) -> float:
        """Return the error of the tool [m] as likely exceeded as not, where the columns leave a mean square [m²]."""
        return self._factor(self.before.stated, float(np.trace(self.whole_weight))) * self._root_with_rest(square)

    def state_limit(self, square: float) -> float:
        """Return the error that 95 of 100 such robots stay below, from that quantile of its square [m²].

        What is stated now is as wide as the rivals of the runs so far make it. The less is left of it, the more the
        limit counts as the error itself does: it never falls below what is as likely exceeded as not.
        """
        now = self._factor(self.before.at_most, self._limit_square)
        later = self._factor(self.before.stated, float(np.trace(self.whole_weight)))
        left = min(np.sqrt(max(square, 0.0) / self._limit_square), 1.0)
        return float(now + max(later - now, 0.0) * (1.0 - left)) * self._root_with_rest(square)

    def describe(self, left: float, left_mm: str, at_most_mm: str) -> str:
        """Say what the session would leave [m], written and as a limit [mm], without a stop."""
        return (
            f"the tool's error {self.where}, {to_mm(self.untraced_error):.3f} mm as stated now (95 % sure below "
            f"{to_mm(self.limit_before):.3f} mm), will be about {left_mm} mm (95 % sure below "
            f"{at_most_mm} mm) once this session is identified with earlier ones"
        )

    @cached_property
    def _limit_square(self) -> float:
        """The square that 95 of 100 robots stay below over the whole workspace before the session [m²]."""
        return square_error_limit(self.whole_weight, np.zeros((0, self.root.shape[1])))

    @property
    def limit_before(self) -> float:
        """What 95 of 100 such robots stay below before the session, where it counts [m]."""
        return self.state_limit(square_error_limit(self.weight_per_prior, np.zeros((0, self.root.shape[1]))))

    def _root_with_rest(self, square: float) -> float:
        return float(np.sqrt(max(square, 0.0) + float(from_mm(self.before.known.file.rest_mm)) ** 2))

    def _factor(self, stated: float, square: float) -> float:
        """Return what is stated over the root of its square, as it was before the session: kept after it."""
        return stated / max(self._root_with_rest(square), 1e-300)


def standing_gauge(cell: Cell, known: ExpectedError) -> StandingGauge | None:
    """Return where the gauge stands, if the cell says that it stands as the runs so far have left it."""
    gauge = known.file.gauge
    return gauge if gauge is not None and cell.gauge.mounting == mounting_of(known) else None


def mounting_of(known: ExpectedError) -> str:
    """Return the name of the last run's set-up; that of the robot found with it, where no plan has named it."""
    named = "" if known.file.gauge is None else known.file.gauge.mounting
    return named or known.file.robot_sha256[:12]


def leave_standing(cell: Cell, before: CalibratedState) -> Cell:
    """Return the cell with the gauge as the runs so far have left it.

    Raises:
        InputError: they do not say where it stands, or the cell has it elsewhere.
    """
    gauge = before.known.file.gauge
    if gauge is None:
        raise InputError(
            f"{before.folder}: does not say where a gauge stands, which --same-mounting needs: identify the run again "
            "(of a bar or wire), or leave --same-mounting out"
        )
    here = {f.name: to_mm(f.p_BX) for f in cell.fixtures}
    for name, place in gauge.fixtures_mm.items():
        # 1e-3: [mm] between places that are one
        if name not in here or np.abs(here[name] - np.array(place)).max() > 1e-3:
            raise InputError(
                f"{cell.path}: fixture '{name}' stands elsewhere than in {before.folder}: leave --same-mounting out"
            )
    name = mounting_of(before.known)
    own = {**cell.file.gauge.own, "mounting": name}
    file = cell.file.model_copy(update={"gauge": cell.file.gauge.model_copy(update={"own": own})})
    return replace(cell, file=file, gauge=replace(cell.gauge, mounting=name))


def _tool_weight(known: ExpectedError, places: ErrorPlaces, spread: Array, anew: int) -> Array:
    """Return the mean square error of the tool at places per squared columns of a root; ``anew`` more move none."""
    own = np.broadcast_to(known.tool, (len(places.q), 3)) if places.p_FM is None else places.p_FM
    tools, which = np.unique(np.round(own, 7), axis=0, return_inverse=True)
    parts = [known.aligned_motion(places.q[which.ravel() == k], spread, tool) for k, tool in enumerate(tools)]
    moved = np.concatenate(parts).reshape(-1, parts[0].shape[-1])
    return np.asarray(block_diag(moved.T @ moved / len(places.q), np.zeros((anew, anew))))


def tool_names(setup: MeasurementSetup) -> list[str]:
    """Names of the three parameters of the first tool point."""
    return tool_point_parameters(next(iter(setup.point_names), ""))


def _gauge_errors(setup: MeasurementSetup, samples: Samples) -> list[Parameter]:
    """Return errors of the gauge whose sizes are known, such as its scale: what no pose tells from the arm's size."""
    known = [f for f in background_families(setup, samples) if f.known]
    return [p for f in known for p in f.parameters if not acts_on_robot(p, setup)]
