"""The command export: what is typed there beside what its verb declares."""

import sys
from inspect import Parameter
from pathlib import Path

from planner.cli.declared import Values, declare_command
from planner.cli.terminal import (
    Manner,
    OutputFile,
    Screen,
    errors,
    evaluation_step,
    print_next,
)
from planner.common.calls import find_function
from planner.common.errors import InputError
from planner.workflow.plan_use_calls import ExportCall


def _export(values: Values, output: str, manner: Manner) -> None:
    name = "-" if output == "-" else Path(output).name
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
    for line in (*made.notes, *made.write(output, manner.force)):
        errors.print(line)
    print_next(f"run {output}, measure; {evaluation_step('run.csv', values['plan'])}")


export_command = declare_command(ExportCall, _export, output=(OutputFile, Parameter.empty))
