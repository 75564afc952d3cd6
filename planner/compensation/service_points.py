"""Points of mastering and service: they belong to the robot's own axes and marks, and are never corrected."""

import re

_SERVICE = re.compile(
    r"mas(?:ter)?_?ref|master(?:ing|_?pos)|(?:brake|brems(?:en)?)_?test|justage|service_?pos|sync_?pos"
    r"|calib(?:ration)?_?pos|_calib$|rev_?count|eichen",
    re.IGNORECASE,
)
SENTENCE = "is a mastering or service point, which belongs to the robot's own axes: it is never corrected"


def is_service_name(name: str) -> bool:
    """Return whether a point, routine or file of this name is for mastering or service."""
    return _SERVICE.search(name) is not None
