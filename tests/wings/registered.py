"""What each extension has registered, as texts. It is run as a program in an installation as well."""

import json
from importlib import import_module

TABLES = {
    "planner.cell.section_registry": ("_READERS",),
    "planner.common.advice": ("_ADVICE",),
    "planner.common.commands": ("_COMMANDS", "_NAMES", "_REMOTE"),
    "planner.session.evaluations": ("_EVALUATIONS", "_DRAWN"),
    "planner.workflow.plan_kinds": ("_KINDS",),
}
"""The tables of each module of which a module of ``planner.wings`` calls a function ``register_…``."""


def entries():
    """Every entry of every table, a text each."""
    found = []
    for module, names in TABLES.items():
        for name in names:
            table = getattr(import_module(module), name)
            items = table.items() if isinstance(table, dict) else [("", value) for value in table]
            found += [f"{module}.{name} {key}: {value!r}" for key, value in items]
    return found


def added_by_each():
    """The entries that each module of ``planner.wings`` adds, by its name; under no name what is there before."""
    from planner.common.extensions import shipped_extensions

    added = {"": entries()}
    for module in shipped_extensions():
        before = entries()
        import_module(module)
        added[module.rpartition(".")[2]] = [entry for entry in entries() if entry not in before]
    return added


if __name__ == "__main__":
    print(json.dumps(added_by_each()))
