"""What comes out: how surely each pair will be told apart, and which cannot be."""

from dataclasses import dataclass

UNSURE = 0.8  # power below which a person is told what would help
SURE = 0.98  # power below which an effect that nobody named is taken up as a rival


@dataclass(frozen=True)
class Told:
    """A finding and one of its rivals.

    Attributes:
        finding, rival: names; the finding's with its inner number, where it has one.
        named: whether the identification names the rival; else it is one that other poses would have brought up.
        noncentrality: what is left of the one's predicted readings when the other explains what it can, as a sum of
            squares in noise variances; the less sure of both truths.
        power: chance that the run then speaks a hundred to one for the truth, as the identification asks for.
        before: noncentrality of as many poses chosen by the index alone.
        bound: no set of as many candidates has a larger noncentrality of this pair.
        help: what else would tell a pair apart that is not told surely.
    """

    finding: str
    rival: str
    named: bool
    noncentrality: float
    power: float
    before: float
    bound: float
    help: tuple[str, ...] = ()

    @property
    def pair(self) -> tuple[str, str]:
        """Both names."""
        return self.finding, self.rival

    @property
    def sureness(self) -> str:
        """The power as a person reads it."""
        return f"{100 * self.power:.0f} %" if self.power < 0.995 else "more than 99 %"

    def text(self) -> str:
        """Say it in a line."""
        return (
            f"{self.finding} from {self.rival}: power {self.sureness} (noncentrality {self.noncentrality:.3g}; "
            f"{self.before:.3g} with poses chosen by the index alone)"
        )


@dataclass(frozen=True)
class Separation:
    """How the poses tell findings from their rivals.

    Attributes:
        told: every pair that poses can tell apart.
        inseparable: one sentence for every pair that they cannot, and what would.
        poses: number n of poses chosen.
        gap: no set of as many candidates betters the criterion by more than this factor less one.
        verified: whether that was checked again over all candidates.
        noise: of one reading, as the identification left it [m].
        alone: observability index of as many poses chosen by it alone.
    """

    told: tuple[Told, ...]
    inseparable: tuple[str, ...]
    poses: int
    gap: float
    verified: bool
    noise: float
    alone: float

    def texts(self) -> tuple[str, ...]:
        """Say it in a line for each pair that the identification names, and one for all the others."""
        others = [t for t in self.told if not t.named]
        own = tuple(t.text() for t in self.told if t.named)
        if not others:
            return own
        least = min(others, key=lambda t: t.power)
        effects, them = ("1 more effect", "it") if len(others) == 1 else (f"{len(others)} more effects", "them")
        return (
            *own,
            f"{effects} that nobody named and that poses chosen without a look at {them} would tell with a power below "
            f"{100 * SURE:.0f} %; least surely now {least.text()}",
        )
