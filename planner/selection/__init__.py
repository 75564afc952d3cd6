"""Selection of measuring poses: pruning, DETMAX, exchange, off-grid refinement, and a certificate for each choice."""

from .background import CurveInBackground
from .bounds import bound, check, core
from .certificate import Certificate, Dual, verify
from .curve import IndexCurve, index_curve, knee
from .detmax import Share, detmax
from .exchange import Selection, exchange
from .pruning import prune
from .refinement import Refined, refine

__all__ = [
    "Certificate",
    "CurveInBackground",
    "Dual",
    "IndexCurve",
    "Refined",
    "Selection",
    "Share",
    "bound",
    "check",
    "core",
    "detmax",
    "exchange",
    "index_curve",
    "knee",
    "prune",
    "refine",
    "verify",
]
