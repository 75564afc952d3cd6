"""What every step of the search needs: the dictionary, the bench that fits and judges, and what was refused so far."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from planner.identification import Bench
from planner.tracing.dictionary import Dictionary
from planner.tracing.memory import quick_memory
from planner.tracing.screen import Shade
from planner.tracing.state import State
from planner.tracing.types import Candidate

AGAIN = 1.3  # times more of the residual than when it was refused: an entry is tried again
Say = Callable[[str], None]


@dataclass
class Refused:
    """What was refitted and not kept: why, and how much of the residual it explained then."""

    why: dict[str, str] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)

    def note(self, state: State, because: str) -> None:
        """Take note of why a state's last effect was refused."""
        self.why[state.effects[-1].entry.name] = because

    def judged(self, candidates: Sequence[Candidate], scatter: float) -> None:
        """Take note of what refused candidates explain of a sum of squares."""
        self.share.update({c.entry.name: c.gain / scatter for c in candidates})

    def worth(self, candidate: Candidate, scatter: float) -> bool:
        """Tell whether a candidate is worth a refit: a new one, or one that now explains more of what is left."""
        return candidate.gain / scatter > AGAIN * self.share.get(candidate.entry.name, 0.0)


@dataclass(frozen=True)
class Hunt:
    """One search.

    Attributes:
        dictionary: entries and inner values that each step looks at.
        bench: run, split and judge.
        say: told of progress.
        refused: so far.
        barred: names that may not come again: they drove out what had brought them in.
    """

    dictionary: Dictionary
    bench: Bench
    say: Say
    refused: Refused
    barred: set[str] = field(default_factory=set)

    @property
    def tried(self) -> int:
        """Number of entries and inner values that each step looks at."""
        return len(self.dictionary.items)

    def memory(self, state: State) -> float:
        """How many samples are worth one where effects are screened."""
        return quick_memory(state, self.bench.run.continuous)

    def shade(self, state: State) -> Shade:
        """The space that a state's model spans."""
        return Shade.of(state.fit, self.memory(state))
