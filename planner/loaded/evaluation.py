"""Evaluation of a loaded run as in the EDBB paper (sections 2.2, 4.2), and its comparison with a tracker."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.circular.plan import NEAR_CIRCLE, circles_of
from planner.common.determinism import even_positions, on_one_thread
from planner.common.errors import InputError
from planner.common.units import DEG, MM, UM, Array, mean_by_group, read_only
from planner.fit.run_setup import setup_for_run
from planner.gauges.placement.frames import place_frames
from planner.gauges.placement.solver import FlangePoses, nominal_flange_poses
from planner.kinematics.geometry import bar_state
from planner.loaded.assumptions import SAMPLES, TOLD
from planner.loaded.compliance import bar_deflection, centring_offset, fit_compliances, measured_points, raise_fixture
from planner.loaded.curves import average_curves
from planner.loaded.results import loaded_sentences
from planner.loaded.types import (
    AveragedCurves,
    CentringOffset,
    EvaluatedCircle,
    JointCompliances,
    LoadedEvaluation,
    TrackerComparison,
)
from planner.runs.run import Run


def _check_cell(cell: Cell) -> None:
    """Refuse a cell that does not say where the bar stands.

    Raises:
        InputError: another gauge, no fixture, or no tool point.
    """
    if not cell.gauge.can_be_loaded:
        raise InputError(f"{cell.path}: gauge.kind = '{cell.gauge.kind}', but loaded circles need a bar, 'ldbb'")
    if not cell.fixtures or not cell.tool.known:
        lacking = "[[fixtures]] with position_mm" if not cell.fixtures else "[tool] with map_mm"
        raise InputError(
            f"{cell.path}: {lacking} is missing; the direction of the load follows from where both balls are"
        )


def _check_measured_loads(cell: Cell, curves: Sequence[AveragedCurves], name: str) -> None:
    """Refuse loads beyond what the cell states or the robot may carry.

    Raises:
        InputError: with the load and what is allowed.
    """
    largest = max(float(np.abs(c.loads).max()) for c in curves)
    stated = max((load for c in circles_of(cell) for load in c.loads), default=np.inf)
    if largest > TOLD.overload_ratio * stated:
        raise InputError(
            f"{name}: the bar loads the arm with {largest:.0f} N, but the circles of {cell.path} go up to {stated:g} N "
            "only; check force_N, or loads_N in [[circles]]"
        )
    cell.check_load(largest, f"{name}: the bar loads the arm with {largest:.0f} N", "check force_N, or load less")


def _check_reach(cell: Cell, setup: MeasurementSetup, curves: AveragedCurves, name: str) -> None:
    """Refuse a circle that the bar cannot reach from its fixture.

    Raises:
        InputError: with the distance and the bar's range.
    """
    x = measured_points(setup, curves.q.reshape(-1, curves.q.shape[-1]))
    length = bar_state(x, curves.circle.p_BX).length
    low, high = cell.gauge.length_min, cell.gauge.length_max
    if float(length.min()) < low - TOLD.range_margin or float(length.max()) > high + TOLD.range_margin:
        raise InputError(
            f"{name}: the circle of radius {curves.circle.radius / MM:.1f} mm about "
            f"{np.round(curves.circle.centre / MM, 1).tolist()} mm lies {length.min() / MM:.1f} to "
            f"{length.max() / MM:.1f} mm from fixture '{curves.circle.name}', but the bar of {cell.path.name} reaches "
            f"from {low / MM:g} to {high / MM:g} mm"
        )


def _check_sign(curves: AveragedCurves, name: str) -> None:
    """Refuse forces of the wrong sign: a pull shortens the bar between arm and table, never lengthens it.

    Raises:
        InputError: with how the reading follows the load.
    """
    force, length = curves.force.mean(axis=(0, 2)), curves.length.mean(axis=(0, 2))
    slope = float(np.polyfit(force, length, 1)[0])
    each = (curves.length - curves.length[:, :1])[:, 1:] / (curves.force - curves.force[:, :1])[:, 1:]
    scatter = float(each.mean(axis=2).std() / np.sqrt(each[..., 0].size)) + 1e-15
    if slope > TOLD.sure_sigmas * scatter:
        way = "pull" if force[-1] > 0 else "push"
        raise InputError(
            f"{name}: the bar at fixture '{curves.circle.name}' reads {slope * 100 / UM:+.1f} µm for each 100 N more "
            f"of force_N, as if the arm yielded against its load (a negative compliance). The column force_N "
            f"is positive where the bar pulls the arm to the fixture: check the sign, the log calls it a {way}"
        )


def problems_of(found: JointCompliances) -> tuple[str, ...]:
    """Return the reasons not to use the compliances."""
    return tuple(
        f"{n} came out at {v * 1e6:.3f} ± {s * 1e6:.3f} µrad/Nm, negative beyond its uncertainty: no joint yields "
        "against its load; something else bends (base, tool, links), or forces or joint angles are wrong"
        for n, v, s in zip(found.names, found.value, found.std, strict=True)
        if v < -TOLD.sure_sigmas * s
    )


def warnings_of(circles: Sequence[EvaluatedCircle], found: JointCompliances) -> tuple[str, ...]:
    """Return the warnings for a person."""
    out = []
    for c in circles:
        name, curves = c.curves.circle.name, c.curves
        if len(curves.loads) < TOLD.linear_loads:
            out.append(
                f"fixture '{name}': {len(curves.loads)} loads give a stiffness, but do not show whether the arm "
                f"yields in proportion; {TOLD.linear_loads} or more would"
            )
        if int(curves.repeats.min()) < 2:
            out.append(
                f"fixture '{name}': some loads were driven once only; repeats (the paper has five) show the noise"
            )
        if len(curves.directions) < 2:
            out.append(f"fixture '{name}': driven in one sense only, so backlash cannot be told from the error")
        second = float((c.centre_offset**2).sum()) / (4 * float(curves.length.mean()))
        if second > TOLD.curved_offset:
            out.append(
                f"fixture '{name}': the circle is {np.linalg.norm(c.centre_offset) / MM:.1f} mm off its ball, so "
                f"{second / UM:.0f} µm of the kinematic error twice a turn are its geometry; centre it better"
            )
    if found.misfit > TOLD.agreeing_ratio:
        out.append(
            f"the loads' curves differ {found.misfit:.1f} times as much as the repeats do: play, friction, links that "
            "bend as well, or a load that is not what was logged; the uncertainties allow for it"
        )
    return tuple(out)


def compare_with_tracker(cell: Cell, setup: MeasurementSetup, circle: EvaluatedCircle, run: Run) -> TrackerComparison:
    """Compare the kinematic error of a circle with a tracker's run of it.

    The tracker's frame is found from the run itself on the nominal robot. What that takes up, shifts and turns of the
    whole circle, shows in the bar's length as a constant and a first harmonic, which are taken off both.

    Raises:
        InputError: it is no run of a tracker, or not of this circle.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: the comparison needs a tracker's x_mm, y_mm, z_mm")
    curves = circle.curves
    x = measured_points(setup, run.samples.q)
    theta, off = curves.circle.to_polar(x)
    on = np.flatnonzero(off < NEAR_CIRCLE * curves.circle.radius)
    if len(on) < len(curves.theta) // 4:
        raise InputError(
            f"{run.name}: only {len(on)} of its samples lie on the circle about "
            f"{np.round(curves.circle.centre / MM, 1).tolist()} mm: it is a run of another path"
        )
    error = _radial_error(setup, curves.circle.p_BX, run.take(on), x[on])
    seen = _on_grid(run, theta[on], error, curves.theta)
    bar = circle.kinematic[_senses(curves, theta[on])].mean(axis=0)
    bar, seen = _without_offset(curves.theta, bar), _without_offset(curves.theta, seen)
    apart = np.abs(bar - seen)
    return TrackerComparison(read_only(seen), float(apart.mean()), float(apart.max()))


def _senses(curves: AveragedCurves, theta: Array) -> list[int]:
    """Which of the bar's senses of travel the tracker's run has too, as positions; all where it has none of them."""
    way = np.sign(np.diff(np.unwrap(theta)))
    share = {d: float(np.mean(way == d)) for d in curves.directions}
    return [k for k, d in enumerate(curves.directions) if share[d] > SAMPLES.sense_share] or list(
        range(len(curves.directions))
    )


def _radial_error(setup: MeasurementSetup, p_BX: Array, run: Run, x: Array) -> Array:
    """Error of the measured point along the bar, (n,) [m]."""
    few = run.take(even_positions(len(run), 400))  # samples tell where the tracker stands
    stand = FlangePoses.of_one(*nominal_flange_poses(setup, few.samples.q))
    assert few.readings.position is not None
    assert run.readings.position is not None
    found = place_frames(stand, few.readings.position, setup.p_FM[:1])
    p_BM = run.readings.position @ found.R_BG[0].T + found.p_BG[0]
    return np.asarray(np.einsum("ni,ni->n", p_BM - x, bar_state(x, p_BX).direction))


def _on_grid(run: Run, theta: Array, error: Array, grid: Array) -> Array:
    """Mean error at every angle of the grid, (B,) [m]; short gaps are bridged by straight lines."""
    B = len(grid)
    where = np.minimum((theta % (2 * np.pi) / (2 * np.pi / B)).astype(int), B - 1)
    count = np.bincount(where, minlength=B)
    if np.mean(count > 0) < SAMPLES.least_coverage:
        raise InputError(
            f"{run.name}: its samples cover {100 * float(np.mean(count > 0)):.0f} % of the circle only; a whole turn "
            "is needed"
        )
    there = np.flatnonzero(count)
    mean = mean_by_group(error, where)[there]
    return np.asarray(np.interp(grid, grid[there], mean, period=2 * np.pi))


def _without_offset(theta: Array, y: Array) -> Array:
    y = y - y.mean()
    return np.asarray(y - centring_offset(theta, y).sine(theta))


@on_one_thread
def evaluate_loaded_circles(
    run: Run, cell: Cell, tracker: Run | None = None, overshoot: float | None = None
) -> LoadedEvaluation:
    """Evaluate a run of loaded circles, one or more fixtures.

    ``overshoot`` is how much of either end of a pass is left out [rad]; ``None``: as the cell says.

    Raises:
        InputError: run and cell do not belong together, the loads are too few, too large or of the wrong sign, or what
            was driven is no circle.
        NoSolutionError: the fit does not come to rest.
    """
    _check_cell(cell)
    setup = setup_for_run(cell, run)
    curves = average_curves(setup, run, _overshoot(cell, overshoot))
    _check_measured_loads(cell, curves, run.name)
    for c in curves:
        _check_reach(cell, setup, c, run.name)
        _check_sign(c, run.name)
    circles: tuple[EvaluatedCircle, ...] = ()
    for _ in range(2):  # rounds: the second with the fixture where the first found it
        told = fit_compliances(setup, curves)
        found = told.compliances
        circles = tuple(
            _evaluate_circle(raise_fixture(setup, c, float(h)), c, found)
            for c, h in zip(curves, told.heights, strict=True)
        )
        setup = _recentre_fixtures(setup, circles)
    if tracker is not None:
        circles = _add_tracker(cell, setup, circles, tracker)
    sentences, warnings = loaded_sentences(circles, found), (*run.warnings, *warnings_of(circles, found))
    return LoadedEvaluation(run.name, cell.robot.name, circles, found, sentences, problems_of(found), warnings)


def _overshoot(cell: Cell, wanted: float | None) -> float:
    """What is left out at either end of a pass [rad]: as wanted, else what the cell's circles run over there."""
    there = min((c.overshoot for c in circles_of(cell)), default=SAMPLES.paper_overshoot)
    if wanted is not None and circles_of(cell) and wanted > there + 1e-9:
        raise InputError(
            f"--overshoot-deg {wanted / DEG:g} would drop more than the passes of {cell.path} run over at either "
            f"end of their turn, {there / DEG:g} degrees (circles.overshoot_deg)"
        )
    return there if wanted is None else wanted


def _evaluate_circle(setup: MeasurementSetup, curves: AveragedCurves, found: JointCompliances) -> EvaluatedCircle:
    yielded = bar_deflection(setup, curves, found.value)
    compensated = curves.length - yielded
    averaged = compensated.mean(axis=1)
    averaged = averaged - averaged.mean(axis=1, keepdims=True)
    offset = centring_offset(curves.theta, averaged.mean(axis=0))
    return EvaluatedCircle(
        curves=curves,
        predicted=read_only(yielded[:, 1:] - yielded[:, :1]),
        compensated=read_only(compensated),
        spread=float(np.ptp(compensated, axis=1).max()),
        spread_rms=float(np.sqrt(np.mean(compensated.std(axis=1) ** 2))),
        bent=_nonlinearity(curves),
        averaged=read_only(averaged),
        offset=offset,
        centre_offset=read_only(_centre_offset(curves, offset)),
        kinematic=read_only(averaged - offset.sine(curves.theta)),
    )


def _nonlinearity(curves: AveragedCurves) -> float:
    """Largest range [m] that the readings at one angle keep about their best straight line over the load."""
    force = curves.force - curves.force.mean(axis=1, keepdims=True)
    length = curves.length - curves.length.mean(axis=1, keepdims=True)
    slope = (force * length).sum(axis=1, keepdims=True) / (force**2).sum(axis=1, keepdims=True)
    return float(np.ptp(length - slope * force, axis=1).max())


def _centre_offset(curves: AveragedCurves, offset: CentringOffset) -> Array:
    """Offset of the circle's centre from the fixture's axis, (2,) [m], from the sine that it makes.

    The bar leans by γ to the circle's plane; a shift m of the centre changes its length by cos γ (m · direction).
    """
    lean = curves.circle.radius / float(np.hypot(curves.circle.radius, curves.circle.height))
    return np.array([-offset.amplitude * np.sin(offset.phase), offset.amplitude * np.cos(offset.phase)]) / lean


def _recentre_fixtures(setup: MeasurementSetup, circles: tuple[EvaluatedCircle, ...]) -> MeasurementSetup:
    """Return the setup with every fixture where its centring offset says it is."""
    p_BX = np.array(setup.p_BX)
    for c in circles:
        circle = c.curves.circle
        below = circle.centre - circle.height * circle.axes[2]
        p_BX[circle.place] = below - c.centre_offset @ circle.axes[:2]
    return replace(setup, p_BX=read_only(p_BX))


def _add_tracker(
    cell: Cell, setup: MeasurementSetup, circles: tuple[EvaluatedCircle, ...], run: Run
) -> tuple[EvaluatedCircle, ...]:
    if len(circles) > 1:
        raise InputError(
            f"{run.name}: a tracker's run is compared with one circle, but the bar was driven at {len(circles)} "
            "fixtures; evaluate the fixture of that run alone"
        )
    cell.check_robot(run)
    return (replace(circles[0], tracker=compare_with_tracker(cell, setup, circles[0], run)),)
