"""A cause that a run shows: its size, how likely it is and what else it may be; many of one kind are one."""

from math import exp, inf, isfinite, log
from typing import ClassVar, Literal, get_args

from pydantic import ValidationInfo, computed_field, field_validator, model_validator

from planner.common.units import display_unit
from planner.effects.nonparametric import NONPARAMETRIC
from planner.model.document_section import DocumentSection, Probability

Grade = Literal["found", "likely", "doubtful"]


def p_value(log_p: float) -> float:
    """Return the chance of this natural logarithm."""
    return exp(max(log_p, -700.0))  # logarithm of the smallest chance that JSON's numbers hold without loss


def log10_p(log_p: float) -> float | None:
    """Return the common logarithm of the chance of this natural logarithm, ``None`` where it is not finite."""
    return log_p / log(10) if isfinite(log_p) else None


def cause_text(name: str) -> str:
    """Return a cause in words: by its name in the catalogue, else by its place and the quantity that drives it."""
    kind, _, place = name.partition(", ")
    return f"a cause without a name ({place})" if kind == NONPARAMETRIC else name


def percent(probability: float) -> str:
    """Write a probability in whole percent; none that is not certain is called so."""
    if 0.0 < probability < 1.0:
        return f"{min(max(100 * probability, 1.0), 99.0):.0f} %"
    return f"{100 * probability:.0f} %"


def grade_of(probability: float | None) -> Grade:
    """Return what a cause of this probability is called; one of which none was drawn, as in older files, is found."""
    asserted, even_chance = 0.9, 0.5  # from which on a cause is asserted, and below which another, or none, is likelier
    if probability is None or probability >= asserted:
        return "found"
    return "likely" if probability >= even_chance else "doubtful"


class OtherValue(DocumentSection):
    """Another value that an inner number may have, and how likely it has that if the cause acts."""

    in_unit = ("value",)
    value: float
    unit: str
    probability: Probability


class InnerNumber(DocumentSection):
    """The number inside an effect: a frequency, a time constant, a width; ``others`` are what else it may be."""

    in_unit = ("value", "std")
    if_any = ("others",)
    name: str = ""
    value: float
    std: float | None = None
    unit: str
    others: tuple[OtherValue, ...] = ()


def inner_unit(unit: str, value: float) -> tuple[str, float]:
    """Return how an inner number of the SI ``unit`` and of about this ``value`` is written, and the factor to it."""
    # numbers inside φ are written in other units than errors are
    return {"1/turn": ("", 1.0), "m": ("mm", 1e3)}.get(unit) or display_unit(unit, value)


class RejectedEffect(DocumentSection):
    """An effect that was tried in full and not kept; ``probability`` where the posterior decided it."""

    if_any = ("probability",)
    name: str
    because: str
    probability: Probability | None = None


class Member(DocumentSection):
    """One cause at one place; its parameters are those of the group ``effect, on``.

    Attributes:
        effect, on: what and where, for instance ``gear ripple`` and ``joint 3``.
        value, std, unit: size of the effect (length of its parameters' vector) and, its shape held, how well that is
            known.
        p_value: chance of so large an effect, corrected for everything that was tried; ``None`` of what no stage has.
        log10_p: its logarithm, which runs out of digits later; then it is ``None``.
        gain: fall of the rms error on held-out samples by this effect [m].
        probability: that it is this cause and no other; ``None`` where no posterior was drawn, as in older files, and
            where a cell states no better than readings show where something stands: it is then surely off by some.
        rivals: other causes that explain the same, the likeliest first; ``unnamed`` is what the catalogue lacks.
        rival_probabilities: of each; 0 where the readings speak against it, but the poses need not have told.
        note: what a mechanic would say; ``inner``: the number inside the effect, where it has one.
        after_sample: of a step, the samples before it; ``surely_within`` a range, or ``between_sessions`` of two files.
        row: number of the sample, from 1, whose reading is wrong.
        beside_stages: true where the posterior holds it and no stage of the fit has it: size and gain are those of the
            posterior.
    """

    in_unit = ("value", "std")
    if_any: ClassVar[tuple[str, ...]] = (
        "probability", "rival_probabilities", "inner", "after_sample", "surely_within", "between_sessions", "row",
        "beside_stages",
    )  # fmt: skip
    effect: str
    on: str
    value: float
    std: float = 0.0
    unit: str
    p_value: float | None = 0.0
    log10_p: float | None = None
    gain: float = 0.0
    probability: Probability | None = None
    rivals: tuple[str, ...] = ()
    rival_probabilities: tuple[Probability, ...] | None = None
    note: str = ""
    inner: InnerNumber | None = None
    after_sample: int | None = None
    surely_within: tuple[int, int] | None = None
    between_sessions: tuple[str, str] | None = None
    row: int | None = None
    beside_stages: Literal[True] | None = None

    @model_validator(mode="before")
    @classmethod
    def _known_grade(cls, data: object) -> object:
        """Refuse a file that calls a cause what none is called; what it is called follows from the probability."""
        grades = get_args(Grade)
        if isinstance(data, dict) and data.get("grade", "found") not in grades:
            raise ValueError(
                f"grade must be {', '.join(map(repr, grades[:-1]))} or {grades[-1]!r}, not {data['grade']!r}"
            )
        return data

    @field_validator("rival_probabilities")
    @classmethod
    def _one_each(cls, value: tuple[float, ...] | None, info: ValidationInfo) -> tuple[float, ...] | None:
        if value is not None and len(value) != (count := len(info.data.get("rivals", ()))):
            raise ValueError(f"must be one for each of the {count} rivals")
        return value

    @computed_field  # type: ignore[prop-decorator]
    @property
    def grade(self) -> Grade:
        """What it is called: found where it is asserted, of many of one kind all of them; likely below; doubtful."""
        return grade_of(self.probability)

    @property
    def is_doubtful(self) -> bool:
        """Whether another cause, or none, is likelier."""
        return self.grade == "doubtful"

    @property
    def log_p(self) -> float:
        """Natural logarithm of the chance."""
        return -inf if self.log10_p is None else self.log10_p * log(10)

    @property
    def name(self) -> str:
        """Effect and place, as the group of its parameters is called."""
        return f"{self.effect}, {self.on}"

    @property
    def rival_texts(self) -> tuple[str, ...]:
        """Rivals in words, the likeliest first, with their probabilities where these are known."""
        chance = dict(zip(self.rivals, self.rival_probabilities or (), strict=False))
        return tuple(cause_text(r) + (f" ({percent(chance[r])})" if r in chance else "") for r in self.rivals)


class Finding(Member):
    """A cause that the run shows: one, or many of one kind as the one thing that they are.

    Of many, ``on`` names all places (``joints 1, 2, 5``). The size is the root mean square of theirs, which are draws
    of one random effect, and its deviation says how well so few tell it, not how well any one is known. Chance,
    probability and grade are those of the least certain. The gain is that of the one that brings most, by itself: what
    all of them bring together is not computed.

    Attributes:
        members: the many: a reflector each time that it was seated anew, play of joint after joint.
    """

    if_any: ClassVar[tuple[str, ...]] = (*Member.if_any, "members")
    members: tuple[Member, ...] | None = None

    @property
    def title(self) -> str:
        """Effect and place, and how often it came."""
        steps = self.members if self.members and self.members[0].after_sample is not None else ()
        return f"{self.name}, {len(steps)} times" if steps else self.name

    @property
    def each(self) -> tuple[Member, ...]:
        """The many, else the finding itself."""
        return self.members or (self,)
