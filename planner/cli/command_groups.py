"""Under which heading the list of all commands shows each of them: in the order in which a person needs them."""

GROUPS = {
    "Plan": ("plan", "study", "loaded-places", "plan-both"),
    "Measure": ("simulate", "import", "centre", "measure"),
    "Calibrate": ("identify", "accuracy", "circular", "loaded"),
    "Use": ("export", "compensate"),
    "Keep": ("plan-check", "check", "record"),
}
MORE = "More"
"""Heading of all others, those that an extension brings among them."""


def group_of(command: str) -> str:
    """Return the heading of a command."""
    return next((group for group, names in GROUPS.items() if command in names), MORE)


def in_order(commands: list[str]) -> list[str]:
    """Return commands in the order of their headings."""
    known = [name for names in GROUPS.values() for name in names]
    return sorted(commands, key=lambda name: known.index(name) if name in known else len(known))
