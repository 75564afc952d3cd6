"""Comment lines of tables, as people write them and as spreadsheets save them."""

CELL_ENDS = ",;\t "  # what a spreadsheet puts behind the only cell of a line: the separators of the empty ones


def remark_of(line: str) -> str | None:
    """Return the text of a comment line, without its ``#`` and the quotation marks of a spreadsheet.

    ``None``: the line is no comment.
    """
    text = line.strip("\ufeff \t\r\n")
    if text.startswith('"#'):
        text = text.rstrip(CELL_ENDS).strip('"').replace('""', '"')
    return text.lstrip("# \t") if text.startswith("#") else None
