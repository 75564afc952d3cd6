"""What the tests know of pose lists, by its manuals."""

from tests.programs.controllers import DialectFacts

REFUSED = ["home,1,2", "move,,1,2,3", "pause,1,,,,,,,,,,", "mark", '{"kind": "run"},', '{"kind": "dwell"},', "dwell,,5"]
DIALECTS = {
    "poses-csv": DialectFacts(stop=r"^pause,", wait=r"^wait,", shown='"pose 3 of 4: read the gauge, then go on"'),
    "poses-json": DialectFacts(
        stop=r'^\{"kind": "pause"', wait=r'^\{"kind": "wait"', shown='"pose 3 of 4: read the gauge, then go on"'
    ),
}
