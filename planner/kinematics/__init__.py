"""The chain of elementary transforms and its forward pass, robots by DH, MDH and URDF, bodies, inverse kinematics."""

__all__ = [
    "angle_units", "axes", "axes_line", "bodies", "chain", "geometry", "inverse_kinematics", "nominal_model",
    "packages", "robot", "robot_file", "robot_hash", "robot_reader", "robot_writer", "urdf", "urdf_writer",
]  # fmt: skip
