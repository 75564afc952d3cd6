"""The reader of each robot language: statements with their places, and what they make the robot do."""

__all__ = ["declared", "execution", "fanuc", "gcode", "krl", "pdl2", "rapid", "statements", "urscript"]
