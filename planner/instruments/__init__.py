"""Measurements with an evaluation of their own: accuracy, centring, checks, circular test, loaded bar, simulation."""

__all__ = [
    "assumptions",
    "centring", "check", "circular", "fleet", "live_advice", "live_gauge", "live_session", "loaded", "more_poses",
    "next_session", "opcua", "precision", "record", "remaining_errors", "simulation", "tracker_nests", "truth",
    "validation", "where_it_counts",
]  # fmt: skip
