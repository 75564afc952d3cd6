"""The command export: what is typed there beside what its verb declares."""

import sys
from pathlib import Path

from planner.cli.declared import Values, declare_command
from planner.cli.default_output import new_folder_of_files
from planner.cli.terminal import (
    Manner,
    OutputFile,
    Screen,
    check_file,
    errors,
    evaluation_step,
    print_next,
    results,
)
from planner.common.calls import find_function
from planner.common.errors import InputError
from planner.common.files import is_folder
from planner.common.summary import fact_lines
from planner.workflow.plan_use_calls import ExportCall


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
