"""By what the plan of a check is known, and what is said of it."""

FORECAST = "shows.json"
"""File beside the plan of a check: what it will show."""
CHECK_NOTE = "these poses tell what has changed since the calibration; they do not calibrate"
"""Among the notes of such a plan."""
DRAWN_FOR_CHECK = (
    "this is the plan of a check, and a newly drawn robot was simulated: where the calibration was not of a robot "
    "drawn with the same seed, its check fails. --truth RUN.csv simulates the robot of the calibration's simulated run"
)
