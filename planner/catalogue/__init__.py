"""The catalogue of physical causes: which effects a run may show, each with a name, a size and a source."""

from planner.catalogue.offered import catalogue
from planner.catalogue.types import Entry, Inner

__all__ = ["Entry", "Inner", "catalogue"]
