"""Cross-validation: which samples are held out together, and the error on samples that the fit did not see."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.cell.cell import MeasurementSetup
from planner.common.units import Array
from planner.effects.basis import ONE, Times
from planner.effects.effect import ParameterMove, tool_point_parameters
from planner.effects.phi_keys import columns_of, depends_on_run
from planner.fit.least_squares import Fit, fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge
from planner.model.identification_document import Metrics
from planner.model.model import Model
from planner.runs.run import Run, Samples


def validate_fit(found: Fit, run: Run, bare: MeasurementSetup) -> Metrics:
    """Return the errors of the fitted model on another run [m], as :func:`validation_residual` has them."""
    return Metrics.of(validation_residual(found, run, bare))


def validation_residual(found: Fit, run: Run, bare: MeasurementSetup) -> Array:
    """Return the residuals (n, r) [m] of the fitted model on another run; frames of that run alone are fitted on it.

    ``bare`` is the setup of that run with nothing placed yet.
    """
    setup = found.setup
    model = _fix_without_time(found, run)
    if not setup.gauge.needs_new_frames(setup, run):
        problem = FitProblem.of(model, renumber_places(run, setup))
        return problem.residual(np.zeros(0))
    model = _with_frames(replace(model, setup=locate_gauge(_calibrated_tool(bare, found), run)))
    here = fit(FitProblem.of(model, run, found.problem.whitener.noise))
    return here.problem.residual(here.errors)


def _fix_without_time(found: Fit, run: Run) -> Model:
    """Fix the fitted model; what hangs on the fitted run's own clock or sessions stands at its mean over that run.

    So does what hangs on a column that ``run``, which is to be judged, does not have.
    """
    model = found.model.fix_at(found.errors)

    def standing(move: ParameterMove) -> ParameterMove:
        """Return the move, with the mean of its φ in the place of one that means nothing outside the run."""
        key = move.phi.key
        if not depends_on_run(key) and all(getattr(run.samples, c) is not None for c in columns_of(key)):
            return move
        return replace(move, phi=Times(float(np.mean(found.problem.context.value(move.phi))), ONE))

    fixed = tuple((replace(p, moves=tuple(standing(m) for m in p.moves)), v) for p, v in model.fixed)
    return replace(model, fixed=fixed)


def transferable_model(found: Fit, run: Run) -> tuple[Model, np.ndarray] | None:
    """Return the fitted model as it holds for another run, and which of its parameters that has, (k,) int.

    The others stand at their mean, as of :func:`validation_residual`. ``None`` where the run stands in new frames.
    """
    if found.setup.gauge.needs_new_frames(found.setup, run):
        return None
    columns = run.samples

    def is_there(key: str) -> bool:
        """Tell whether φ can be evaluated in another run."""
        return not depends_on_run(key) and all(getattr(columns, c) is not None for c in columns_of(key))

    which = [k for k, p in enumerate(found.model.parameters) if all(is_there(m.phi.key) for m in p.moves)]
    model, free = _fix_without_time(found, run), [found.model.parameters[k] for k in which]
    names = {p.name for p in free}
    fixed = tuple((p, value) for p, value in model.fixed if p.name not in names)
    return replace(model, parameters=tuple(free), fixed=fixed), np.array(which, dtype=int)


def renumber_places(run: Run, setup: MeasurementSetup) -> Run:
    """Number the places of the run as the setup does."""
    order = np.array([setup.place_names.index(name) if name in setup.place_names else 0 for name in run.places])
    return replace(run, samples=replace(run.samples, place=order[run.samples.place]))


def _calibrated_tool(bare: MeasurementSetup, found: Fit) -> MeasurementSetup:
    """Return the setup with the tool points as fitted, so that placing the new frames does not touch them."""
    setup = found.setup
    p_FM = np.array(setup.p_FM)
    for t, name in enumerate(setup.point_names):
        p_FM[t] += found.at(tool_point_parameters(name))
    return replace(bare, p_FM=p_FM, R_FM=setup.R_FM, point_names=setup.point_names, tool_prior=0.0)


def _with_frames(model: Model) -> Model:
    """Free the frames of the new run, everything else fixed as fitted; the tool's shift now stands in the setup."""
    fixed = tuple((p, v) for p, v in model.fixed if p.group != "gauge")
    frames = [p for p in Model.of(model.setup, frozenset()).parameters if p.group == "gauge"]
    return replace(model, parameters=tuple(frames), fixed=fixed)


FEWEST_GROUPS = 5  # placements or sessions that make a split of their own: else a fold is too large a part


@dataclass(frozen=True)
class Split:
    """Groups of samples that stay together, distributed over folds.

    Attributes:
        by: ``pose``, ``placement``, ``session``, ``block`` (of a static run in its order) or ``stretch``.
        group: of every sample, (n,) int.
        fold: of every sample, (n,) int from 0.
        fine: poses with their repeats, or stretches: what scatters for itself, (n,) int.
    """

    by: str
    group: np.ndarray
    fold: np.ndarray
    fine: np.ndarray

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(np.unique(self.group))

    def take(self, which: np.ndarray) -> "Split":
        """Return the split of the samples at ``which``, the folds as they are."""
        return Split(self.by, self.group[which], self.fold[which], self.fine[which])


def split_run(run: Run, hold_out: float = 0.2, seed: int = 0) -> Split:
    """Split a run into folds that each hold about the share ``hold_out`` of its groups."""
    by, group = run_groups(run)
    labels, group = np.unique(group, return_inverse=True)
    group = group.reshape(-1)
    folds = min(len(labels), max(2, round(1 / hold_out)))
    if by in ("stretch", "block"):
        deal = np.arange(len(labels)) % folds
    else:
        order = np.random.default_rng(seed).permutation(len(labels))
        deal = np.empty(len(labels), dtype=int)
        deal[order] = np.arange(len(labels)) % folds
    fine = np.unique(finest_groups(run), return_inverse=True)[1].reshape(-1)
    return Split(by, group, deal[group], fine)


def finer_split(run: Run, whole: Split) -> Split | None:
    """Return a split by single poses beside one by sessions, placements or blocks; ``None`` if it is as fine already.

    What comes anew with each session or placement cannot be predicted where that is held out whole; here it can.
    """
    if whole.by not in ("session", "placement", "block"):
        return None
    labels, group = np.unique(whole.fine, return_inverse=True)
    deal = np.random.default_rng(0).permutation(len(labels)) % whole.folds
    return Split("pose", whole.fine, deal[group.reshape(-1)], whole.fine)


def run_groups(run: Run) -> tuple[str, np.ndarray]:
    """Return the kind of group and the group of every sample, (n,).

    Whole placements and whole sessions where there are enough of them. Of three whole ones each fold would lose a
    third of the run, and all that was measured about one fixture: then it is blocks of the run in its order, every fold
    with its share of each.
    """
    samples = run.samples
    stood = samples.place if run.readings.length is None else np.zeros(len(run), dtype=int)
    if len(np.unique(stood)) >= FEWEST_GROUPS:
        return "placement", stood
    if run.continuous:
        return "stretch", _stretches(len(run))
    session = np.zeros(len(run), dtype=int) if samples.session is None else samples.session
    if _are_balanced(session):
        return "session", session
    whole = finest_groups(run)
    # 3: placements or sessions from which on neighbours in the run's order are held out together
    if max(len(np.unique(session)), len(np.unique(stood))) >= 3:
        block = join_groups(_stretches(len(run)), whole)
        if len(np.unique(block)) >= 2 * FEWEST_GROUPS:  # poses measured again and again would chain them all
            return "block", block
    return "pose", whole


def finest_groups(run: Run) -> np.ndarray:
    """Return the finest groups that stay together, (n,): poses with their repeats, or stretches."""
    return _stretches(len(run)) if run.continuous else join_groups(number_poses(run.samples.q), _own_poses(run.samples))


def _own_poses(samples: Samples) -> np.ndarray | None:
    """Return the numbers of the poses (n,), those of another plan's under numbers of their own.

    Files of several plans count from one each; what bears a number and stands elsewhere is another pose.
    """
    pose, file = samples.pose, samples.file
    if pose is None or file is None or not len(pose):
        return pose
    first = np.unique(pose, return_index=True, return_inverse=True)
    # 1.0: [deg] of a joint, from where the pose of one number was first: another one
    apart = np.abs(samples.q - samples.q[first[1][first[2]]]).max(axis=1) > np.deg2rad(1.0)
    return np.where(apart & (pose >= 0), pose + (1 + file) * (pose.max() + 1), pose)


def _stretches(n: int) -> np.ndarray:
    # 8: stretches for each fold of a continuous run: every fold sees every part of it
    return np.arange(n) * (8 * 5) // max(1, n)


def _are_balanced(session: np.ndarray) -> bool:
    """Tell whether sessions can be folds: enough of them hold a fair share of the run, and none holds most of it."""
    share = np.unique(session, return_counts=True)[1] / len(session)
    # 0.03: of the samples that a session must hold to count
    return bool((share > 0.03).sum() >= FEWEST_GROUPS and share.max() <= 0.5)


def number_poses(q: Array) -> np.ndarray:
    """Number the poses (n, N) [rad] so that a pose measured again has the number of the first time, (n,)."""
    same_pose = np.deg2rad(0.01)  # joint angles closer than this are the same pose measured again
    return np.unique(np.round(q / same_pose).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)


def number_targets(samples: Samples) -> np.ndarray:
    """Number the poses, each at its place and target, in the order in which they were first measured, (n,)."""
    label = np.stack([number_poses(samples.q), samples.place, samples.point_numbers], axis=1)
    first, group = np.unique(label, axis=0, return_index=True, return_inverse=True)[1:]
    return np.asarray(np.argsort(np.argsort(first))[group.reshape(-1)])


def join_groups(a: np.ndarray, b: np.ndarray | None) -> np.ndarray:
    """Join the groups a (n,) that share a group of b (n,), negative numbers of b standing for none, (n,)."""
    if b is None:
        return a
    known = b >= 0
    b = np.unique(b, return_inverse=True)[1].reshape(-1)
    edges = coo_array((np.ones(known.sum()), (a[known], a.max() + 1 + b[known])), shape=(a.max() + b.max() + 2,) * 2)
    return np.asarray(connected_components(edges, directed=False)[1][a])


@dataclass(frozen=True)
class HeldOutPrediction:
    """Residuals on samples that were held out.

    Attributes:
        residual: reading − prediction by the fit without the sample's fold, (n, r) [m, rad].
        shift: what taking out each fold moves the parameters by, (folds, P).
        refitted: names of parameters that were fitted on the held-out samples, for only these know them.
    """

    residual: Array
    shift: Array
    refitted: tuple[str, ...]


def predict_held_out(fit: Fit, split: Split, sizes: Array | None = None) -> HeldOutPrediction:
    """Predict every sample by the fit without its fold.

    With ``sizes`` (d, P) it is the mean over fits with these prior sigmas over the fit's own; at 0 a parameter is out.
    """
    every = np.ones((1, len(fit.errors))) if sizes is None else sizes
    grams, z = _grams(fit.problem, fit.errors, split), fit.errors / fit.problem.prior
    return _predict_all(fit, split, grams, np.where(every > 0, np.nan, -z), every)


def predict_held_out_without(
    fit: Fit, split: Split, effects: Sequence[Sequence[int]], known: Sequence[int] = ()
) -> Iterator[HeldOutPrediction]:
    """Yield for each effect the prediction of every held-out sample without it, all other parameters fitted again.

    Args:
        fit: with all of them; its noise and prior sigmas stay.
        split: of the fit's samples.
        effects: positions of each effect's parameters.
        known: positions of parameters that stay as they are.
    """
    grams = _grams(fit.problem, fit.errors, split)
    for which in effects:
        step = np.full((1, len(fit.errors)), np.nan)
        step[:, list(known)] = 0.0
        step[:, list(which)] = -(fit.errors / fit.problem.prior)[list(which)]
        yield _predict_all(fit, split, grams, step, np.ones_like(step))


def _predict_all(fit: Fit, split: Split, grams: Array, steps: Array, sizes: Array) -> HeldOutPrediction:
    """Predict every sample by the mean over fits, (d, P) each.

    ``steps``: given steps in prior sigmas, NaN where the step is to be solved for; ``sizes``: prior sigmas over the
    fit's own, used where they are not 0.
    """
    problem, errors = fit.problem, fit.errors
    steps, own = steps_without_folds(grams, errors / problem.prior, steps, sizes)
    shift, names = problem.prior * steps, fit.model.names
    return HeldOutPrediction(
        _shift_residual(problem, errors, shift, split), shift, tuple(names[j] for j in np.flatnonzero(own.any(axis=0)))
    )


def steps_without_folds(grams: Array, z: Array, steps: Array, sizes: Array) -> tuple[Array, np.ndarray]:
    """Return the steps in prior sigmas to the fits without each fold (folds, P), and which it alone knows, the same.

    Args:
        grams: information [J r]ᵀ[J r] of every fold, per prior sigma, (folds, P + 1, P + 1).
        z: values in prior sigmas, (P,).
        steps, sizes: given steps and prior sigmas (d, P), over which the mean is taken; see :func:`_predict_all`.
    """
    total = grams.sum(axis=0)
    shift = np.zeros((len(grams), len(z)))
    own = np.zeros(shift.shape, dtype=bool)
    for f, gram in enumerate(grams):
        alone = known_alone(gram[:-1, :-1], total[:-1, :-1])
        for step, size in zip(steps, sizes, strict=True):
            mine = np.isnan(step) & alone
            shift[f] += _step_without(total - gram, gram, z, mine, step, size) / len(steps)
            own[f] |= mine
    return shift, own


def known_alone(gram: Array, total: Array) -> np.ndarray:
    """Tell of each parameter, (P,), whether only this fold knows it: products (P, P) in it and over all."""
    none = 1e-9  # share of a column's information below which training says nothing of its parameter
    return np.asarray(np.diag(gram) > (1 - none) * np.diag(total))


def _grams(problem: FitProblem, errors: Array, split: Split) -> Array:
    """Information [J r]ᵀ[J r] of every fold, (folds, P+1, P+1), by the columns that a fit kept, if any."""
    kept, problem.memory.folds = problem.memory.folds, None
    if kept is not None and kept.problem is problem and np.array_equal(kept.fold, split.fold):
        return kept.grams_with(problem.weighted_residual(errors))
    columns, size = problem.white_columns(errors).factored, len(errors) + 1
    out = np.zeros((split.folds, size, size))
    for f in np.unique(split.fold).tolist():
        out[f] = columns.take(np.flatnonzero(split.fold == f)).gram
    return out


def _step_without(train: Array, fold: Array, z: Array, own: np.ndarray, step: Array, size: Array) -> Array:
    """Step in prior sigmas from the whole fit to the fit by the ``train`` information.

    Parameters that only the fold knows (where its plate lies) are then fitted on the fold itself.
    """
    move = np.where(np.isnan(step), 0.0, step)
    for which, gram in ((~own & np.isnan(step), train), (own, fold)):
        at = np.flatnonzero(which)
        if len(at):
            scale, whole = size[at], len(at) == len(move)
            H = gram[:-1, :-1] * scale if whole else gram[np.ix_(at, at)] * scale
            H *= scale[:, None]
            H.flat[:: len(at) + 1] += 1.0
            right = scale * (gram[at, -1] - gram[at, :-1] @ move) - z[at] / scale
            factor = cho_factor(H.T, overwrite_a=True, check_finite=False)
            move[at] = scale * cho_solve(factor, right, check_finite=False)
    return move


def _shift_residual(problem: FitProblem, errors: Array, shift: Array, split: Split) -> Array:
    """Residuals (n, r) after moving the parameters by the shift of each sample's fold."""
    linear = problem.linearize(errors)
    out = np.array(linear.residual)
    for f in np.unique(split.fold):
        mine = np.flatnonzero(split.fold == f)
        out[mine] -= linear.columns.take(mine).times(shift[f])
    return out
