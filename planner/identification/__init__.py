"""From a run to a calibration, stage by stage, with tests of the residual and warnings."""

__all__ = ["fleet_fit", "joint_sessions", "pipeline"]
