"""The verbs: plan a cell, write the plan, export a program, study what can be seen."""

from planner.workflow.export import export_plan
from planner.workflow.plan import plan
from planner.workflow.planning import Options, Stages, programs
from planner.workflow.writing import write_plan, write_program_as

__all__ = ["Options", "Stages", "export_plan", "plan", "programs", "write_plan", "write_program_as"]
