"""What a session wants of the pose that a move ends at: a pulse, a row of the log, or nothing."""

from dataclasses import dataclass, replace

from planner.program.instructions import Instruction, JointMove, LogAxes, Sync


@dataclass(frozen=True)
class Mark:
    """What the instructions between a move and the next want of the pose that the move ends at."""

    sync: int | None = None
    log: int | None = None

    @property
    def pose(self) -> int | None:
        """Return the pose that is marked, if one is."""
        return self.sync if self.sync is not None else self.log


def marks(instructions: tuple[Instruction, ...]) -> list[Mark]:
    """Return for each instruction the marks that stand between it and the next move."""
    mark = Mark()
    ahead: list[Mark] = []
    for item in reversed(instructions):
        ahead.append(mark)
        match item:
            case JointMove():
                mark = Mark()
            case Sync(pose=pose):
                mark = replace(mark, sync=pose)
            case LogAxes(pose=pose):
                mark = replace(mark, log=pose)
            case _:
                pass
    return ahead[::-1]
