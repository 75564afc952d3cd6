"""How good the robot is expected to be at a program's own targets, before and after they are corrected."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from planner.common.determinism import even_positions
from planner.common.summary import Fact, under_key
from planner.common.units import MM, Array, to_mm
from planner.compensation.targets import Target, group_tool_points, line_ranges
from planner.compensation.tolerances import WORSE_RATIO
from planner.documents.expected_error import ExpectedError


@dataclass(frozen=True)
class ToolErrors:
    """Expected errors [m], (n,), of the targets with one tool, on their ``lines``; ``tool`` says which tool it is.

    ``measured``: it is the tool point that was measured.
    """

    tool: str
    measured: bool
    lines: tuple[int, ...]
    before: Array
    after: Array


@dataclass(frozen=True)
class ProgramError:
    """Expected errors of a program's corrected targets, tool by tool.

    Attributes:
        parts: one for each tool.
        targets: number of corrected targets, of which the parts hold some, evenly, where they are many.
        left: of targets that are left as they were [m], (k,); they keep it.
    """

    parts: tuple[ToolErrors, ...]
    targets: int
    left: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def before(self) -> Array:
        """Errors of all targets looked at before they are corrected, (n,) [m]."""
        return np.concatenate([p.before for p in self.parts])

    @property
    def after(self) -> Array:
        """Errors of the same targets after they are corrected, (n,) [m]."""
        return np.concatenate([p.after for p in self.parts])

    @property
    def lines(self) -> np.ndarray:
        """Lines of the targets in the file, (n,) int."""
        return np.concatenate([np.array(p.lines) for p in self.parts])

    @property
    def is_worse(self) -> bool:
        """Whether the correction is expected to do more harm than good."""
        return _rms(self.after) > WORSE_RATIO * _rms(self.before)

    @property
    def refusal(self) -> str:
        """Say why such a correction is not written."""
        return (
            f"the corrected targets are expected to be off by {_mm(_rms(self.after))} mm rms, more than the "
            f"{_mm(_rms(self.before))} mm of the robot as it is: nothing is written; measure more poses like those of "
            "this program, or identify with the posterior mean of all effects (without --geometry)"
        )

    @property
    def facts(self) -> list[Fact]:
        """What is to be expected at the targets, corrected and left as they were, before and after, tool by tool."""
        shown = len(self.before)
        which = "1 target" if self.targets == 1 else f"{self.targets} targets"
        which = which if shown == self.targets else f"{shown} of the {which}"
        change = f"{_mm(_rms(self.before))} → {_mm(_rms(self.after))} mm  rms at the {which} (base aligned)"
        facts = [("tool error", f"{change}, worst {_mm(self.before.max())} → {_mm(self.after.max())} mm")]
        if len(self.parts) > 1 or not self.parts[0].measured:
            parts = (f"{_mm(_rms(p.before))} → {_mm(_rms(p.after))} mm  rms with {p.tool}" for p in self.parts)
            facts += under_key("by tool", parts)
        if (worse := self.lines[self.after > WORSE_RATIO * self.before]).size:
            facts.append(("worse", f"than before, as is expected, on lines {line_ranges(worse.tolist())}"))
        if count := len(self.left):
            those = "1 target" if count == 1 else f"{count} targets"
            kept = f"{_mm(_rms(self.left))} mm  rms at the {those} left as they were, worst {_mm(self.left.max())} mm"
            facts.append(("", kept))
        return facts

    @property
    def details(self) -> list[Fact]:
        """The facts about the targets with the largest errors."""
        return [("worst at", self._worst_text())]

    def content(self) -> dict[str, object]:
        """Return the summary in numbers, line by line."""
        errors = zip(self.lines.tolist(), to_mm(self.before).tolist(), to_mm(self.after).tolist(), strict=True)
        return {
            "before_rms_mm": _rms(self.before) / MM,
            "after_rms_mm": _rms(self.after) / MM,
            **({"left_rms_mm": _rms(self.left) / MM} if len(self.left) else {}),
            "targets": [{"line": k, "before_mm": round(a, 5), "after_mm": round(b, 5)} for k, a, b in errors],
        }

    def _worst_text(self) -> str:
        named = dict[int, float]()
        for k in np.argsort(-self.after, kind="stable"):
            named.setdefault(int(self.lines[k]), float(self.after[k]))
            if len(named) == 5:  # lines that are named
                break
        return ", ".join(f"line {line} {_mm(error)} mm" for line, error in named.items())


def uncorrected_errors(expected: ExpectedError, targets: Sequence[Target], q: Array, p_FM: Array | None) -> Array:
    """Return the errors (n,) [m] of targets that were left uncorrected; arguments as of :func:`program_error`."""
    return program_error(expected, targets, q, p_FM).before if len(targets) else np.zeros(0)


def program_error(expected: ExpectedError, targets: Sequence[Target], q: Array, p_FM: Array | None) -> ProgramError:
    """Return the errors that are expected at corrected targets.

    Args:
        expected: what is known of the robot.
        targets: in the order of the file.
        q: controller angles of the nominal robot at each, (n, N) [rad].
        p_FM: tool point (3,) [m] of joint angles whose program says none; ``None`` is the measured one.
    """
    looked = even_positions(len(targets), 4000)  # targets of a long program that are looked at, evenly
    own = expected.tool if p_FM is None else p_FM
    points = [own if (said := targets[k].tool_point) is None else said for k in looked]
    tools, which = group_tool_points(points)
    return ProgramError(
        tuple(_of_tool(expected, tool, looked[which == k], targets, q) for k, tool in enumerate(tools)), len(targets)
    )


def _of_tool(
    expected: ExpectedError, p_FM: Array, which: np.ndarray, targets: Sequence[Target], q: Array
) -> ToolErrors:
    found = expected.at(q[which], p_FM)
    place = ", ".join(f"{v:.1f}" for v in to_mm(p_FM))
    measured = expected.is_measured(p_FM)
    tool = f"the measured tool point ({place}) mm" if measured else f"another tool ({place}) mm"
    return ToolErrors(tool, measured, tuple(targets[k].line for k in which), found.nominal, found.released)


def _rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))


def _mm(x: float) -> str:
    return f"{x / MM:.3f}"
