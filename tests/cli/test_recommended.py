"""Every command that a message or a page of the program names is one, and has the options that stand behind it."""

import ast
import re
import shlex
from functools import cache
from pathlib import Path

import pytest

import planner
from docs.plain_words import nodes_of
from planner.cli.app import load_command, verbs
from planner.session.evaluations import evaluation_of

SOURCE = Path(planner.__file__).parent
NAMED = re.compile(r"\bedbb ([a-z]+(?:-[a-z]+)*)\b((?:(?!\bedbb )[^;:.`'\"]|\.\w|\.\.\.)*)")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
PROSE = {"is", "serves", "wrote"}  # words after the name that are no commands
OF_ALL = {"--server", "--help", "--version"}


def texts(path):
    """The texts of a module, what is filled in standing as X; of a page all of it."""
    whole = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield whole
        return
    if "edbb " not in whole:  # then it names none: it need not be parsed
        return
    for node in nodes_of(path):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(v.value) if isinstance(v, ast.Constant) else "X" for v in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def named_commands():
    """File, command and options of each command that a text names."""
    for path in sorted(p for end in ("py", "j2", "js") for p in SOURCE.rglob(f"*.{end}") if "three" not in p.parts):
        for text in texts(path):
            for found in NAMED.finditer(text):
                yield path.relative_to(SOURCE).as_posix(), found[1], frozenset(OPTION.findall(found[2]))


FOUND = sorted(set(named_commands()), key=lambda f: (f[0], f[1], sorted(f[2])))


@cache
def options_of(verb):
    return {name for p in load_command(verb).params for name in p.opts} | OF_ALL


@pytest.mark.parametrize(("file", "verb", "options"), FOUND, ids=[f"{f}: {v}" for f, v, _ in FOUND])
def test_what_is_named_is_a_command_with_such_options(file, verb, options):
    if verb not in PROSE:
        assert verb in verbs()
        assert options <= options_of(verb)


def test_many_commands_are_named():
    assert {"identify", "compensate", "plan", "check", "record", "loaded"} <= {verb for _, verb, _ in FOUND}
    assert sum(bool(options) for *_, options in FOUND) > 15


def test_paths_with_blanks_are_single_words_of_what_comes_next(tmp_path):
    run, plan = tmp_path / "my run.csv", tmp_path / "plan of O'Neil" / "plan.json"
    cell = plan.parent / "cell.toml"
    expected = ["edbb", "identify", str(run), "--cell", str(cell), "--plan", str(plan), "-o", "calibrated"]
    assert shlex.split(evaluation_of(run, plan, None, calibrates=True)) == expected


@pytest.mark.slow
def test_what_is_filled_into_a_command_is_a_word_of_its_own():
    """No folder or file stands in a command as it is: a blank in its path would part it."""
    bare = re.compile(r"\bedbb [a-z-]+ [^;:]*?(?:--[a-z-]+|-o|identify|import|plan|add) (\{(?!as_word)[^}]*\})")
    for path in sorted(p for p in SOURCE.rglob("*.py") if "edbb " in p.read_text(encoding="utf-8")):
        for node in nodes_of(path):
            if isinstance(node, ast.JoinedStr):
                parts = (
                    f"{{{ast.unparse(v.value)}}}" if isinstance(v, ast.FormattedValue) else ast.literal_eval(v)
                    for v in node.values
                )
                found = bare.search("".join(parts))
                assert found is None, f"{path}: {found[0]}"
