"""Options as the version before called them: they go on working for this one, with a notice on standard error."""

from collections.abc import Sequence

from planner.cli.terminal import errors
from planner.common.calls import typed_fields
from planner.workflow.verbs import declared_calls

WRITTEN = {  # of commands that are not declared: today's name by the former one
    "measure": {"--gauge": "--serial-port"},
    "centre": {"--program": "--program-to"},
    "record": {"--tool": "--tool-name"},
}
OPTIONS_END = "--"  # what follows it are words, not options


def former_options(verb: str) -> dict[str, str]:
    """Return the options of a command that were renamed: today's name by the former one."""
    call = declared_calls().get(verb)
    fields = typed_fields(call) if call else ()
    return {f.option.former: f.flag for f in fields if f.option.former} | WRITTEN.get(verb, {})


def take_former_options(verb: str, words: Sequence[str]) -> list[str]:
    """Return the words behind a command with today's names for former ones, and say of each what it is called now."""
    renamed = former_options(verb)
    end = words.index(OPTIONS_END) if OPTIONS_END in words else len(words)
    made = [_rename(word, renamed) for word in words[:end]]
    for old in sorted({w.partition("=")[0] for w in words[:end]} & renamed.keys()):
        errors.print(f"edbb {verb}: {old} is called {renamed[old]} now; the old name works in this version only")
    return [*made, *words[end:]]


def _rename(word: str, renamed: dict[str, str]) -> str:
    name, equals, value = word.partition("=")
    return f"{renamed.get(name, name)}{equals}{value}"
