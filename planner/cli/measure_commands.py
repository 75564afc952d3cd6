"""The command that reads a gauge at the cell: measure."""

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import errors, evaluation_step, print_next
from planner.common.errors import InputError

Output = Annotated[Path, typer.Option("-o", "--output", metavar="RUN.csv", help="the run; one begun there goes on")]


def measure_command(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.json", help="a static plan for a bar or wire")],
    gauge: Annotated[str, typer.Option("--gauge", metavar="PORT", help="serial port: COM5, /dev/ttyUSB0")],
    output: Output,
    baud: Annotated[int, typer.Option("--baud", help="of the line")] = 9600,
    protocol: Annotated[
        str, typer.Option("--protocol", help="stream (a number a line, sent by itself), sylvac or mitutoyo")
    ] = "stream",
    factor: Annotated[
        float, typer.Option("--factor", help="of its numbers to millimetres, −1 if it counts down")
    ] = 1.0,
    zero: Annotated[float, typer.Option("--zero-mm", help="length where it shows 0")] = 0.0,
) -> None:
    """Read a bar or wire at a serial port at each pose of a plan, and write the run."""
    from planner.instruments.centring.protocols import find_protocol
    from planner.instruments.live_gauge import STREAM, LiveGauge, measure_poses, open_log
    from planner.session.planned_session import load_session

    if protocol != STREAM:
        _ = find_protocol(protocol)
    session = load_session(plan_file, "measured")
    if session.cell.motion.measure != "static" or session.cell.gauge.columns != "length_mm":
        raise InputError(
            f'{plan_file}: poses are ticked off where the arm rests at each (motion.measure = "static") and a bar or '
            "wire is read; log a continuous session with controller and gauge, and bring both logs in by edbb import"
        )
    log = open_log(output, session.document, session.cell)
    live = LiveGauge(gauge, baud, protocol, factor * 1e-3, zero * 1e-3)
    try:
        for line in measure_poses(log, live.read_settled, _ask, time.monotonic):
            errors.print(line, markup=False)
    finally:
        live.line.close()
    errors.print(f"{len(log.rows)} of {len(log.poses)} poses are measured, written to {output}", markup=False)
    print_next(evaluation_step(output, plan_file))


def _ask(text: str) -> str:
    errors.print(text, markup=False)
    line = sys.stdin.readline()
    return line.strip().lower() if line else "q"
