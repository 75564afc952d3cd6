"""What the tests know of ROS 2 trajectories, by its manuals."""

from tests.programs.controllers import DialectFacts

REFUSED = ["joint_names: [a]", "- {positions: [0.0]}", "points: []", "header: {}", "velocity: 5", "---"]
DIALECTS = {
    "ros2-trajectory": DialectFacts(shown="# FIRST: pose 3 of 4: read the gauge, then publish this file"),
}
