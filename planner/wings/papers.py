"""The two papers that the planner was made from, each statement with our number beside it."""

from planner.common.commands import register_call, register_names
from planner.reproduction.papers_call import PapersCall

PARTS = ("reproduction",)

register_call(PapersCall, needs=("circles", "validation"))
register_names("planner.reproduction.papers_result", "PapersResult", "papers")
