"""The commands at the cell, which read a gauge: centre and measure."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.declared import file_of
from planner.cli.terminal import (
    PLAINLY,
    Json,
    Manner,
    errors,
    evaluation_step,
    print_json,
    print_next,
    print_notes,
    results,
)
from planner.common.errors import InputError

if TYPE_CHECKING:
    from planner.cell.cell import Cell
    from planner.centring.session import CentringAdviser, CentringSession
    from planner.centring.settings import CentringSettings
    from planner.centring.stop import StopRequest
    from planner.kinematics.robot import Robot
    from planner.session.planned_session import PlannedSession


Until = Annotated[
    float | None,
    typer.Option(
        "--until-mm",
        metavar="MM",
        min=0.001,
        max=10.0,
        help="after each pose say the expected error; pass what adds nothing, and all once it is below this, 95 % sure",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="RUN.csv",
        help="the run; a session begun there goes on (default: a file named after the plan)",
    ),
]
After = Annotated[
    Path | None, typer.Option("--after", metavar="CALIBRATED", help="identification of the sessions before")
]


def centre_command(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.json", help="a plan for the gauge trical")],
    robot: Annotated[str | None, typer.Option(metavar="tcp://HOST[:PORT]", help="KUKAVARPROXY's address")] = None,
    indicators: Annotated[
        str | None, typer.Option(metavar="PORT[,PORT,PORT]", help="serial ports of x, y, z; or of one multiplexer")
    ] = None,
    output: Output = None,
    settings_file: Annotated[
        Path | None, typer.Option("--settings", metavar="CENTRING.toml", help="indicators, limits, speeds, time-outs")
    ] = None,
    stop_file: Annotated[
        Path | None, typer.Option("--stop-file", metavar="FILE", help="stop as soon as this file is there")
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="the plan's own program drives the robot and calls at each ball")
    ] = False,
    program: Annotated[
        Path | None, typer.Option("--program-to", metavar="DIR", help="write the robot's own program there, and end")
    ] = None,
    until: Until = None,
    after: After = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="try it: robot, head and indicators are simulated, with errors drawn")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", help="of the simulated robot")] = 0,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """Centre the head of three indicators on the balls of a plan, pose by pose, and record the run."""
    from planner.centring.robot_link import write_centring_program
    from planner.centring.session import open_session
    from planner.centring.settings import read_settings
    from planner.centring.stop import StopRequest
    from planner.kinematics.robot_reader import load_robot

    settings = read_settings(settings_file, plan_file.parent / "cell.toml")
    if program is not None:
        for path in write_centring_program(settings.robot, program, manner.force):
            results.print(f"written to {path}")
        return
    if not simulate and (robot is None or indicators is None):
        raise InputError(
            "edbb centre needs --robot and --indicators (or --simulate, to try it; or --program-to, to write the "
            "robot's program)"
        )
    output = output or Path(file_of(".csv")("centre", plan_file))
    if stop_file is not None and stop_file.exists():
        raise InputError(f"the stop file {stop_file} is there already; remove it to begin")
    planned = _read_session(plan_file, simulate)
    cell = None if planned is None else planned.cell
    session, stop = open_session(plan_file, output), StopRequest(stop_file)
    adviser = _centring_adviser(plan_file, cell, session, until, after)
    if session.pending_visits and simulate and planned:
        _simulate(session, planned, settings, stop, seed, adviser)
    elif session.pending_visits and robot and indicators:
        known = load_robot(session.way.robot) if cell is None else cell.robot
        _run(session, robot, known, indicators.split(","), settings, stop, follow, adviser)
    _print_end(session, output, plan_file, as_json)


def _print_end(session: CentringSession, output: Path, plan_file: Path, as_json: bool) -> None:
    if as_json:
        print_json(_summary(session, output))
        return
    all_of = "all" if not session.pending_visits else f"{len(session.journal.rows)} of"
    results.print(f"{all_of} {len(session.way.visits)} poses are measured, written to {output}")
    print_next(evaluation_step(output, plan_file))


def _read_session(plan_file: Path, needed: bool) -> PlannedSession | None:
    """Return a plan with the cell beside it, once that has a head and the plan holds; nothing without a cell."""
    from planner.programs.dialect import PathForm
    from planner.session.judgement import judge_plan
    from planner.session.neutral_program import session_program
    from planner.session.planned_session import load_session

    if not (needed or (plan_file.parent / "cell.toml").is_file()):
        print_notes((f"no cell.toml lies beside {plan_file}: nothing tells whether its path is as it was proven",))
        return None
    planned = load_session(plan_file, "centred", check=True)
    _ = planned.cell.gauge.indicators  # refused where there are none
    program = session_program(planned.cell, planned.courses, planned.plan_id, PathForm())
    # the planned path itself is driven, from point to point: it was proven whatever programs were written with it
    print_notes(judge_plan(plan_file, planned.cell, program, planned.notes, proven=True))
    return planned


def _centring_adviser(
    plan_file: Path, cell: Cell | None, session: CentringSession, until: float | None, after: Path | None
) -> CentringAdviser:
    """Return who advises: nobody where no goal and no earlier session is given."""
    from planner.centring.session import NoCentringAdvice
    from planner.common.units import from_mm
    from planner.next_session.live_advice import CentringAdvice
    from planner.session.document import read_plan

    if until is None and after is None:
        return NoCentringAdvice()
    if cell is None:
        raise InputError(f"{plan_file}: --until-mm and --after need the cell: no cell.toml lies beside the plan")
    goal = None if until is None else float(from_mm(until))
    advice = CentringAdvice.of(read_plan(plan_file, "robot", "poses"), cell, session.output, goal, after)
    advice.resume(session.journal.rows)
    return advice


def _run(
    session: CentringSession,
    address: str,
    robot: Robot,
    ports: list[str],
    settings: CentringSettings,
    stop: StopRequest,
    follow: bool,
    adviser: CentringAdviser,
) -> None:
    from planner.centring.indicators import open_indicators
    from planner.centring.robot_link import DIALECT, open_link
    from planner.centring.session import CentringBench, run_session
    from planner.centring.settings import find_protocol
    from planner.centring.stop import stop_on_signals

    with ExitStack() as opened:
        opened.enter_context(stop_on_signals(stop))
        head = open_indicators(ports, find_protocol(settings.head.protocol), settings.head, stop)
        opened.callback(head.close)
        link = open_link(address, robot.axes_of(DIALECT), settings.robot, stop, follow)
        opened.callback(link.close)
        bench = CentringBench(head, link, settings, stop, lambda line: errors.print(line), adviser=adviser)
        run_session(session, bench, follow)


def _simulate(
    session: CentringSession,
    planned: PlannedSession,
    settings: CentringSettings,
    stop: StopRequest,
    seed: int,
    adviser: CentringAdviser,
) -> None:
    from planner.centring.session import CentringBench, run_session
    from planner.centring.simulated import SimulatedArm
    from planner.centring.stop import stop_on_signals
    from planner.runs.run import SIMULATED
    from planner.simulation.simulated_run import planned_samples
    from planner.simulation.truth import draw_expected_truth

    samples = planned_samples(planned.cell, planned.document, planned.courses)
    truth = draw_expected_truth(planned.cell, seed, samples)
    arm = SimulatedArm(planned.cell, truth, settings, seed)
    session.journal.remarks = "".join(f"# truth: {line}\n" for line in (SIMULATED, *truth.lines()))
    at_once = settings.model_copy(update={"rest": settings.rest.model_copy(update={"settle_s": 0.0})})
    with stop_on_signals(stop):
        bench = CentringBench(arm, arm, at_once, stop, lambda line: errors.print(line), adviser=adviser)
        arm.move(session.way.q[0])
        run_session(session, bench)


def _summary(session: CentringSession, output: Path) -> dict[str, object]:
    rows = session.journal.rows
    return {
        "plan_id": session.way.plan_id,
        "poses": len(session.way.visits),
        "measured": len(rows),
        "sessions": 1 + max(r.session for r in rows),
        "moves": sum(r.moves for r in rows),
        "run": output.name,
    }


def measure_command(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.json", help="a static plan for a bar or wire")],
    output: Output = None,
    gauge: Annotated[
        str | None, typer.Option("--serial-port", metavar="PORT", help="serial port: COM5; without, values are typed")
    ] = None,
    baud: Annotated[int, typer.Option("--baud", help="of the line")] = 9600,
    protocol: Annotated[
        str, typer.Option("--protocol", help="stream (a number a line, sent by itself), sylvac or mitutoyo")
    ] = "stream",
    factor: Annotated[
        float, typer.Option("--factor", help="of its numbers to millimetres, −1 if it counts down")
    ] = 1.0,
    zero: Annotated[float, typer.Option("--zero-mm", help="length where it shows 0")] = 0.0,
    until: Until = None,
    after: After = None,
) -> None:
    """Read a bar or wire at each pose of a plan, by a serial port or by what a person types, and write the run."""
    from planner.centring.live_session import (
        STREAM,
        Adviser,
        LiveGauge,
        MeasuringSession,
        NoAdvice,
        open_log,
        program_remark,
    )
    from planner.centring.settings import find_protocol
    from planner.common.units import from_mm
    from planner.session.planned_session import load_session

    output = output or Path(file_of(".csv")("measure", plan_file))
    if protocol != STREAM:
        _ = find_protocol(protocol)
    session = load_session(plan_file, "measured")
    if session.cell.motion.is_continuous or session.cell.gauge.columns != "length_mm":
        raise InputError(
            f'{plan_file}: poses are ticked off where the arm rests at each (motion.measure = "static") and a bar or '
            "wire is read. Log a continuous session with controller and gauge, and bring both logs in by edbb import"
        )
    log = open_log(output, session.document, session.cell)
    adviser: Adviser = NoAdvice()
    if until is not None or after is not None:
        from planner.next_session.live_advice import LiveAdvice

        goal = None if until is None else float(from_mm(until))
        advice = LiveAdvice.of(session.document, session.cell, output, goal, after)
        advice.resume(log.rows)
        adviser = advice
    live = None if gauge is None else LiveGauge(gauge, baud, protocol, factor * 1e-3, zero * 1e-3)
    read = None if live is None else live.read_settled_mean
    errors.print(program_remark(session.cell.gauge.read_by))
    try:
        measuring = MeasuringSession(log, _ask, time.monotonic, read, factor * 1e-3, zero * 1e-3, adviser)
        for line in measuring.run():
            errors.print(line)
    finally:
        if live is not None:
            live.line.close()
    results.print(f"{len(log.rows)} of {len(log.poses)} poses are measured, written to {output}")
    print_next(evaluation_step(output, plan_file))


def _ask(text: str) -> str:
    errors.print(text)
    line = sys.stdin.readline()
    return line.strip().lower() if line else "q"
