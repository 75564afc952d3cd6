"""Observability: which parameters the readings can tell apart, how well, and the indices O1 ... O5 of a pose set."""

from .identifiability import STRUCTURAL, Dropped, Identifiability, Weak, identifiable, null_directions
from .indices import RULES, IndexName, IndexRule, Indices, index_value, indices, rule, singular_values
from .information import Covariance, covariance, r_factor, sensitivity
from .sentences import because, written

__all__ = [
    "RULES",
    "STRUCTURAL",
    "Covariance",
    "Dropped",
    "Identifiability",
    "IndexName",
    "IndexRule",
    "Indices",
    "Weak",
    "because",
    "covariance",
    "identifiable",
    "index_value",
    "indices",
    "null_directions",
    "r_factor",
    "rule",
    "sensitivity",
    "singular_values",
    "written",
]
