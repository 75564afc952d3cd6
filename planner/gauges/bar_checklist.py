"""The checklist of a gauge that is held between fixture and tool: a bar's own words, another gauge gives its own."""

from dataclasses import dataclass

from planner.cell.file import CellFile
from planner.cell.gauge_types import CellStep, SessionGuide, place_text


@dataclass(frozen=True)
class BarChecklist:
    """What is set up at a fixture and at the tool, what is clean, how it is attached, and how its load is set."""

    fixture: str = "The magnet cup of fixture"
    tool: str = "The tool's magnet cup holds the ball's centre"
    clean: str = "Balls and cups are wiped clean, everything is tight."
    attach: str = "put one ball of the bar into the fixture's cup, the other into the tool's."
    load: str = ""

    def guide(self, file: CellFile, noun: str, removal: str) -> SessionGuide:
        """Return the steps with it; ``removal`` is what is done after the last pose."""
        places = [
            f"{self.fixture} {f.name} stands at {place_text(f.position_mm)} of the base frame, to about "
            f"{f.prior_mm:g} mm."
            for f in file.fixtures
        ]
        tool = f"{self.tool} at {place_text(file.tool.map_mm)} of the flange." if file.tool else ""
        zero = "Set it to zero as the program asks." if file.gauge.zero == "free" else "Check its known zero."
        carried = " At the next fixture the same, where the program asks for it." if len(file.fixtures) > 1 else ""
        return SessionGuide(
            f"the length of the {noun} (length_mm)",
            (CellStep(f"Fixture and {noun}", " ".join([*places, tool, self.clean])),),
            (CellStep(f"Attach the {noun}", f"Where the program pauses: {self.attach} {zero}{self.load}{carried}"),),
            after=(CellStep("Detach", f"Where the program pauses at its end: {removal}."),),
        )


LOADED = BarChecklist(
    attach="with its load off, put one ball into the fixture's seat, the other into the tool's.",
    load=" Set a load only where the program asks for it; keep your hands away while it pulls.",
)
