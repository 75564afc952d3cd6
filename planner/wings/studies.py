"""Studies: what a cell can show before anything is put up."""

from planner.common.commands import register_call, register_names
from planner.studies.study_call import StudyCall

PARTS = ("studies", "cli/study_commands.py")  # beside this module

register_call(StudyCall, "planner.cli.study_commands:study_command")
register_names("planner.studies.cell_study", "StudyResult", "study")
register_names("planner.studies.observability", "Observability", "SelectedPoses", "observability", "select")
register_names("planner.studies.sweep", "SweepResult", "sweep")
