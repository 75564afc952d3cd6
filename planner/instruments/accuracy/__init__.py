"""How accurate a robot is: by repeated centrings, or by the run of a tracker."""

__all__ = ["precision", "validation"]
