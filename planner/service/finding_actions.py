"""What a person does about a finding: one sentence for each kind of cause."""

GENERAL = "Corrected in programs as far as the joint angles decide; the report says with what it could be confused."
ACTIONS = (  # words of an effect's name, and what to do
    (
        ("gear", "ripple", "encoder", "transmission", "eccentric"),
        "Corrected in programs as far as the angle alone decides. Have the gear of this joint looked at where it "
        "grows from one calibration to the next.",
    ),
    (
        ("compliance", "stiffness", "load", "gravity"),
        "Corrected in programs for the load that was measured. Keep the tool's mass in the controller right, and "
        "measure again with another load.",
    ),
    (
        ("backlash", "hysteresis", "friction", "reversal"),
        "No program can correct it. Approach from one side where it counts, and have the joint's play checked.",
    ),
    (
        ("thermal", "temperature", "warm", "growth", "drift"),
        "Not corrected. Warm the robot up before work, and measure at the temperature at which it works.",
    ),
    (
        ("session", "step", "slip", "moved", "shift"),
        "Something moved during the run. Check fixture, tool flange and gauge, and measure again if it happened in the "
        "middle of the run.",
    ),
    (("lag", "clock"), "It belongs to the logging, not to the robot. Log gauge and robot by one clock."),
    (("reading", "outlier"), "Look at this reading; the ball may not have been seated."),
    (("refraction", "scale", "gauge"), "It belongs to the gauge. Have the gauge or its length standard checked."),
)


def find_action(effect: str) -> str:
    """Return what to do about an effect of this name."""
    name = effect.lower()
    return next((text for words, text in ACTIONS if any(w in name for w in words)), GENERAL)
