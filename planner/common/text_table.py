"""How a table is written as text: the sign between its columns, and the decimal sign of its numbers."""

import re


def separator_of(header: str) -> str:
    """Return the sign between the columns of a table: of comma, semicolon and tab the one that its header has most."""
    return max(",;\t", key=header.count)


def decimal_sign(below: str, separator: str) -> str:
    """Return the decimal sign of the numbers below a header: a comma where they have commas and no points."""
    if separator == ",":
        return "."
    commas, points = (re.search(rf"(?<![\w.,])[-+]?\d+{sign}\d+(?![\w.,])", below) for sign in (",", r"\."))
    return "," if commas and not points else "."


def with_point(cell: str, decimal: str) -> str:
    """Return a cell with a point as decimal sign; of a table with commas one with a point is no number."""
    return cell if decimal == "." else cell.replace(".", "?").replace(decimal, ".")
