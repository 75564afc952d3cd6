"""Numbers as people and instruments write them into files."""


def parse_number(text: str) -> float:
    """Return the number that ``text`` spells, in the digits 0 to 9.

    Python's own ``float`` also takes the digits of other scripts and ``1_000``, which no other reader of a file does.

    Raises:
        ValueError: it is no number, or none in these digits.
    """
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text!r} is no number in the digits 0 to 9")
    return float(text)
