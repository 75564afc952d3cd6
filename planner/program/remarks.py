"""What a person must know before a program is started: told in its head, and in the notes of the plan."""

from planner.program.dialect import Dialect
from planner.program.instructions import Centre, Program, Sync, WaitInput
from planner.program.lowering import Step
from planner.program.numbers import fixed

NUMBERS = ("tool", "base", "load")


def cautions(program: Program, dialect: Dialect, steps: tuple[Step, ...]) -> tuple[str, ...]:
    """Return what the program does not do by itself, or not where one would think; one sentence each."""
    found = []
    if program.sync_output is None and any(isinstance(i, Sync) for i in program.instructions):
        found.append("no output marks the poses and none is touched, the cell names no controller.sync_output")
    if program.gauge_input is None and any(isinstance(i, WaitInput) for i in program.instructions):
        found.append(
            "no input says that the gauge is ready, the operator alone goes on, "
            "the cell names no controller.gauge_input"
        )
    by_hand = [f"{name} {getattr(program, name)}" for name in NUMBERS if _unsaid(program, dialect, name)]
    if by_hand:
        found.append(f"select {', '.join(by_hand)} by hand before the start, the program does not")
    if any(s.kind == "unlogged" for s in steps):
        found.append(
            "the axis angles in passing are not logged by this program, a continuous session needs the actual "
            f"positions of the axes recorded with {dialect.trace}, which edbb import reads"
        )
    passing = any(s.kind in ("sync_on", "log_passing") or (s.move is not None and s.move.pulse) for s in steps)
    if dialect.sync.passing and passing:
        found.append(dialect.sync.passing)
    return tuple(found)


def explanations(program: Program, dialect: Dialect) -> tuple[str, ...]:
    """Return what the program's signals and selections mean, and what must exist on the controller for them."""
    notes = [
        dialect.sync.note if program.sync_output is not None else "",
        dialect.wait_note if program.gauge_input is not None else "",
        dialect.select.note,
        dialect.centre.note if dialect.centre and any(isinstance(i, Centre) for i in program.instructions) else "",
    ]
    place = "[" + ", ".join(fixed(v, 3) for v in program.map_mm) + "]"
    told = (dialect.signal(n, program.sync_output, program.gauge_input) for n in notes if n)
    return tuple(n.replace("{map}", place) for n in told)


def _unsaid(program: Program, dialect: Dialect, name: str) -> bool:
    return getattr(program, name) is not None and not getattr(dialect.select, name)
