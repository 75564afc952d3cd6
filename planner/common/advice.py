"""What an extension does where the core can not: the ends of sentences that it adds to messages and guides."""

from enum import Enum, auto

from planner.common.extensions import load_extensions


class Occasion(Enum):
    """Where the core asks what an extension would say."""

    PLANNING_ELSEWHERE = auto()  # a package of planning is missing here
    PROVING_ELSEWHERE = auto()  # a program cannot be judged here
    LOADED_RUN = auto()  # a run as driven under load stands beside one at rest; it is told the ``run``
    STRONG_PULL = auto()  # the bar pulled while it was read
    NO_CENTRING_CALL = auto()  # a language cannot call a routine that centres
    READ_BY_HAND = auto()  # how a session is measured where a person reads the gauge; ``PLAN`` stands for its path
    CENTRED_SESSION = auto()  # how a session with a head of indicators is measured; ``PLAN`` stands for its path
    CENTRED_COLUMNS = auto()  # who writes the columns of centred balls
    CLUSTER_KEYS = auto()  # who makes the keys of a cluster: the whole sentence without its stop
    CENTRED_BALL = auto()  # the whole sentence on how a ball is centred


_ADVICE: dict[Occasion, str] = {}


def register_advice(occasion: Occasion, sentence: str) -> None:
    """Let the core say a sentence, or the end of one, where it asks for it; ``{…}`` are filled in.

    Raises:
        ValueError: another extension says something there.
    """
    if occasion in _ADVICE:
        raise ValueError(f"advice {occasion.name}: another extension has registered it already")
    _ADVICE[occasion] = sentence


def advice(occasion: Occasion, otherwise: str = "", **told: object) -> str:
    """Return the advice that an extension has registered for a place; ``otherwise`` if there is none."""
    load_extensions()
    sentence = _ADVICE.get(occasion)
    return otherwise if sentence is None else sentence.format(**told)
