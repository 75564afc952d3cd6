"""Where loaded circles tell the joints' compliances apart: places, their choice, and what each number of them knows."""

from planner.study.softness.beside import choose_beside
from planner.study.softness.both import Both, predicted_both
from planner.study.softness.choice import Known, Places, choose_places
from planner.study.softness.circles import Candidate, candidates, driven
from planner.study.softness.run import places_study

__all__ = [
    "Both",
    "Candidate",
    "Known",
    "Places",
    "candidates",
    "choose_beside",
    "choose_places",
    "driven",
    "places_study",
    "predicted_both",
]
