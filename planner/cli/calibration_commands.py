"""The commands that write one file (simulate, import, compensate).

The command export: what is typed there beside what its verb declares.
"""

import re
import sys
from pathlib import Path

import typer

from planner.cli.declared import Values, declare_command, new_file, new_folder_of_files
from planner.cli.terminal import (
    Manner,
    OutputFile,
    Screen,
    check_file,
    errors,
    evaluation_step,
    give_file,
    print_next,
    print_notes,
    results,
    screen_of,
)
from planner.common.calls import find_function
from planner.common.console import as_word
from planner.common.errors import PARTLY_DONE, InputError
from planner.common.files import is_folder
from planner.common.summary import SCREEN_LINES, fact_lines
from planner.workflow.compensate_call import AXES, CompensateCall
from planner.workflow.core_calls import ExportCall, ImportCall, SimulateCall

FILE = (OutputFile, None)


def _simulate(values: Values, output: str, manner: Manner) -> None:
    check_file(output, manner.force)
    with Screen():
        made = find_function(SimulateCall)(**values)
        text = made.text()
    print_notes(made.run.warnings, manner.verbose)
    give_file(text, lambda path: made.write(path, manner.force), output, evaluation_step(output, values["plan"]))


def _import(values: Values, output: str, manner: Manner) -> None:
    check_file(output, force=True)  # a run bears no mark: whether it is the same is known once it is made
    with Screen():
        run = find_function(ImportCall)(**values)
        from planner.runs.writer import run_text, save_run
    print_notes(run.warnings, manner.verbose)
    screen_of(output).print("\n".join(fact_lines([("imported", run.counts_text)])))
    step = _evaluation_step(output, values.get("plan"))
    give_file(run_text(run), lambda path: save_run(run, path, manner.force), output, step)


def _evaluation_step(run: str, plan: Path | None) -> str:
    """Return the command that evaluates a run, of a plan if there is one; a cell that is not beside it has a word."""
    if plan is not None and (Path(plan).parent / "cell.toml").is_file():
        return evaluation_step(run, Path(plan))
    its = f"--plan {as_word(plan)} " if plan else ""
    return f"edbb identify {as_word(run)} --cell CELL {its}-o calibrated"


def _compensate(values: Values, output: str, manner: Manner) -> None:
    check_file(output, manner.force, into_folder=True)
    with Screen():
        more = {"zeros_set": _axes(values.get("zeros_set", "")), "force": manner.force}
        done = find_function(CompensateCall)(**{**values, **more})
    if output == "-" and done.others:
        names = " and ".join(f.name for f in (done.file, *done.others))
        raise InputError(f"-o -: {names} are written together; name a file or a folder")
    if output != "-":
        done.check(output, manner.force)
    screen_of(output).print(done.full_summary(manner.verbose, SCREEN_LINES - 1))
    step = "" if output == "-" else done.next_step(output)
    give_file(done.file.text, lambda _: done.write(output, manner.force), output, step)
    if done.partly:
        raise typer.Exit(PARTLY_DONE)


def _axes(text: str) -> tuple[int, ...]:
    """Return the numbers of axes that an option lists."""
    if text and not re.fullmatch(AXES, text):
        raise InputError(f"--zeros-set '{text}': numbers of axes are allowed, such as 2,3,4")
    return tuple(sorted({int(word) for word in text.split(",") if text}))


simulate_command = declare_command(SimulateCall, _simulate, new_file(".csv"), output=FILE)
import_command = declare_command(ImportCall, _import, new_file(".csv"), output=FILE)
compensate_command = declare_command(CompensateCall, _compensate, new_folder_of_files, output=FILE)


def _export(values: Values, output: str, manner: Manner) -> None:
    check_file(output, manner.force, into_folder=True)
    in_folder = is_folder(output)
    name = "-" if output == "-" or in_folder else Path(output).name
    with Screen():
        made = find_function(ExportCall)(**values, name=name)
    if output == "-":
        if len(made.programs) > 1:
            names = ", ".join(f.name for f in made.programs)
            raise InputError(
                f"dialect '{values['dialect']}' writes {len(made.programs)} files ({names}); give a file name with -o"
            )
        sys.stdout.write(made.programs[0].text)
        return
    if in_folder:
        Path(output).mkdir(parents=True, exist_ok=True)
        output = str(Path(output) / made.programs[0].name)
    for note in made.notes:
        errors.print(note)
    said = made.write(output, manner.force)
    results.print("\n".join([*fact_lines([("written to", output)]), *said]))
    print_next(f"run {output}, measure; {evaluation_step('run.csv', values['plan'])}")


export_command = declare_command(ExportCall, _export, new_folder_of_files, output=(OutputFile, None))
