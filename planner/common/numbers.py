"""Numbers as people and instruments write them into files, and as sentences count."""


def number_of(number: int, noun: str) -> str:
    """Return a number of things in words, such as ``1 pose`` and ``2 poses``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def parse_number(text: str) -> float:
    """Return the number that ``text`` spells, in the digits 0 to 9.

    Python's own ``float`` also takes the digits of other scripts and ``1_000``, which no other reader of a file does.

    Raises:
        ValueError: it is no number, or none in these digits.
    """
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text!r} is no number in the digits 0 to 9")
    return float(text)
