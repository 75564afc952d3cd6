"""What the tests know of LeRobot actions, by its manuals."""

from tests.programs.controllers import DialectFacts

REFUSED = ["0.0333,1.0,2.0,", "move", "timestamp,a.pos,event", "0.1,0.1,0.1,0.1,0.1,0.1,0.1,run", "1,2,3"]
DIALECTS = {
    "lerobot": DialectFacts(shown="# FIRST: pose 3 of 4: read the gauge, then play this file"),
}
