"""Expands templates of URDFs by the package ``xacro`` (wiki.ros.org/xacro), in a process of its own.

A template is a stranger's file, and ``xacro`` evaluates Python. So the process reads the template's folder and the
packages that the user has named, writes nothing, knows no environment, and ends after some seconds. Its expressions
are arithmetic, names, calls and tables.
"""

import ast
import errno
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import planner
from planner.common.errors import InputError
from planner.common.files import MOST_TOML, check_readable
from planner.common.system import limit_process
from planner.kinematics.packages import Packages

MOST_SECONDS = 20  # ur_description takes less than one for an arm
MOST_BYTES = 2_000_000_000  # of memory
EXPRESSION = (
    ast.Expression, ast.Constant, ast.Name, ast.Attribute, ast.Subscript, ast.Slice, ast.Call, ast.keyword, ast.List,
    ast.Tuple, ast.Dict, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.expr_context, ast.operator,
    ast.unaryop, ast.boolop, ast.cmpop,
)  # fmt: skip


def expand_template(path: Path, packages: Packages, most_seconds: int = MOST_SECONDS) -> bytes:
    """Return the URDF that the template at ``path`` makes.

    Raises:
        InputError: the template is wrong, asks for a file outside its folder and the named packages, for a name of
            Python's own, or for more work than a robot needs; or the package ``xacro`` is not installed.
    """
    check_readable(path, MOST_TOML)
    if find_spec("xacro") is None:
        raise InputError(f"{path}: is read by the package xacro, which is not installed: pip install xacro")
    folders = {name: str(folder.resolve()) for name, folder in packages.folders.items()}
    asked = {"path": str(path.resolve()), "packages": folders, "most_seconds": most_seconds}
    where = os.pathsep.join([str(Path(planner.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    try:  # -P: no module is taken from the folder in which the command runs, which may be the template's
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__],
            input=json.dumps(asked),
            capture_output=True,
            encoding="utf-8",
            timeout=most_seconds,
            env={**os.environ, "PYTHONPATH": where},
        )
        answer = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError) as err:
        reason = "it asks for more work than any robot needs: a macro, file or list that grows without end?"
        raise InputError(f"{path}: cannot be expanded: {reason}") from err
    if "urdf" not in answer:
        raise InputError(f"{path}: cannot be expanded: {answer['error']}")
    for name in answer["files"]:
        check_readable(Path(name), MOST_TOML)
    return bytes(answer["urdf"], "utf-8")


def main() -> None:
    """Expand the template that standard input names; the answer goes to standard output."""
    asked, answers, sys.stdout = json.load(sys.stdin), sys.stdout, sys.stderr
    limit_process(MOST_BYTES, 0, asked["most_seconds"])
    packages = Packages({name: Path(folder) for name, folder in asked["packages"].items()})
    try:
        answer = _expand(asked["path"], packages)
    except (Exception, RecursionError) as err:
        answer = {"error": _reason(err)}
    answers.write(json.dumps(answer))


def _expand(path: str, packages: Packages) -> dict[str, object]:
    """Return the URDF and the files that were read besides the template."""
    import xacro

    _tell_packages(packages)
    _refuse_names(xacro)
    os.environ.clear()
    xacro.process_doc(xacro.parse("<robot/>"))  # whatever else it imports is imported before doors close
    _keep_to([Path(path).parent, *packages.folders.values()])
    document = xacro.parse(None, path)
    arguments: dict[str, str] = {}
    for node in document.documentElement.childNodes:  # the root's own attributes may name arguments
        if node.nodeName == "xacro:arg" and "$" not in node.getAttribute("default"):
            arguments.setdefault(node.getAttribute("name"), node.getAttribute("default"))
    xacro.init_stacks(path)
    xacro.process_doc(document, mappings=arguments)
    urdf = document.documentElement.toxml()
    if len(urdf) > MOST_TOML:
        raise InputError(f"it makes more than {MOST_TOML} letters")
    return {"urdf": urdf, "files": [f for f in xacro.all_includes if os.path.exists(f)]}


def _tell_packages(packages: Packages) -> None:
    """Answer ``$(find NAME)`` in the place of ROS's own index of packages."""
    index = ModuleType("ament_index_python.packages")
    vars(index)["get_package_share_directory"] = lambda name: str(packages.find(name))
    sys.modules |= {"ament_index_python": ModuleType("ament_index_python"), index.__name__: index}


def _refuse_names(xacro: Any) -> None:
    """Let an expression be evaluated once it was found to be plain, and without what leads to Python's own names."""
    from xacro import substitution_args

    for name in ("type", "vars"):
        dict.pop(xacro._global_symbols["python"], name)
    evaluate, substitute = xacro.safe_eval, substitution_args._eval

    def evaluate_plain(text: str, *names: Any) -> object:
        check_expression(text)
        return evaluate(text, *names)

    def substitute_plain(text: str, context: Any) -> object:
        check_expression(text)
        return substitute(text, context)

    xacro.safe_eval, substitution_args._eval = evaluate_plain, substitute_plain


def check_expression(text: str) -> None:
    """Refuse an expression that is more than arithmetic, names, calls and tables, or names what is Python's own.

    Raises:
        ValueError: it is.
    """
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        if not isinstance(node, EXPRESSION):
            raise ValueError(f"{type(node).__name__} is not read in an expression")
        name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
        if name.startswith("_") or name in ("format", "format_map", "mro"):
            raise ValueError(f"the name '{name}' is not read in an expression")


def _keep_to(folders: list[Path]) -> None:
    """From now on let this process open nothing outside these folders."""
    roots = [folder.resolve() for folder in folders]

    def guard(event: str, details: tuple[Any, ...]) -> None:
        if event == "open" and not any(Path(details[0]).resolve().is_relative_to(root) for root in roots):
            shown = ", ".join(map(str, roots))
            told = (
                f"outside the folders that this template may read ({shown}). Name the package that holds it by "
                "--package NAME=DIR, or in the table [packages] of robot.toml or cell.toml"
            )
            raise PermissionError(errno.EACCES, told, details[0])

    sys.addaudithook(guard)


def _reason(err: BaseException) -> str:
    """Return what is wrong and where, from the error that ``xacro`` has wrapped."""
    import xacro

    inner, said = err, ""
    while isinstance(inner, xacro.XacroException) and inner.exc is not None:
        said = " ".join((inner.suffix or said).split())
        inner = inner.exc
    files, macros = xacro.filestack or ["?"], [m.body.getAttribute("name") for m in xacro.macrostack or []]
    place = f"{Path(files[-1]).name}{f', macro {macros[-1]}' if macros else ''}"
    return f"{inner or type(inner).__name__} {said}".strip() + f" (at {place})"


if __name__ == "__main__":
    main()
