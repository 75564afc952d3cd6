"""What a person does with a bar or a wire at the cell: where both its ends go, how precisely, and its zero."""

from dataclasses import dataclass
from math import hypot

from planner.cell.file import CellFile, FixtureFile, ToolFile
from planner.cell.gauge_types import CellStep, SessionGuide, place_text
from planner.common.choices import SetUp
from planner.common.units import UM, to_mm


@dataclass(frozen=True)
class BarChecklist:
    """What is set up at a fixture and at the tool, what is clean, how it is attached, and how its load is set."""

    fixture: str = "The magnet cup of fixture {name} holds the ball's centre"
    tool: str = "The tool's magnet cup holds the ball's centre"
    ends: str = "between the centres of its two balls"
    adjust: str = "drive the tool's ball there and adjust the cup to it"
    clean: str = "Balls and cups are wiped clean, everything is tight."
    attach: str = "put one ball of the bar into the fixture's cup, the other into the tool's."
    load: str = ""

    def guide(
        self, file: CellFile, noun: str, removal: str, usual: SetUp, zero_sigma: float, stands: bool = False
    ) -> SessionGuide:
        """Return its steps.

        Args:
            file: of the cell.
            noun: what the gauge is called.
            removal: what is done after the last pose.
            usual: how its fixtures come to their place where the cell does not say.
            zero_sigma: one sigma of a zero that is to be found [m].
            stands: whether fixtures and zero are as another run left them.
        """
        places = [self._place_text(file, noun, f, f.set_up or usual) for f in file.fixtures]
        zero = self._zero_text(file, noun, zero_sigma)
        if stands:
            places = [
                "Leave every fixture as it stands since the run before; where one was moved, plan anew without "
                "--same-mounting."
            ]
            zero = "Leave its zero as it is: do not set it anew, do not switch it off."
        tool = [self._tool_text(file, file.tool)] if file.tool else []
        span = [self._range_text(noun, file.gauge.length_mm)] if file.gauge.length_mm else []
        carried = " At the next fixture the same, where the program asks for it." if len(file.fixtures) > 1 else ""
        return SessionGuide(
            f"the length of the {noun} (length_mm)",
            (CellStep(f"Fixture and {noun}", " ".join([*places, *tool, *span, self.clean])),),
            (CellStep(f"Attach the {noun}", f"Where the program pauses: {self.attach} {zero}{self.load}{carried}"),),
            after=(CellStep("Detach", f"Where the program pauses at its end: {removal}."),),
        )

    def _place_text(self, file: CellFile, noun: str, fixture: FixtureFile, set_up: SetUp) -> str:
        """Say where a fixture stands, how precisely it must, and what happens where it stands elsewhere."""
        adjust = self.adjust if set_up == "robot" else "measure it from the robot's base"
        near = f"{2 * fixture.prior_mm:g} mm"  # 2: standard deviations, for which a plan keeps room at the bar's ends
        where = f"at {place_text(fixture.position_mm)} of the base frame"
        said = f"{self.fixture.format(name=fixture.name)} {where}: {adjust}."
        if "fixture" not in file.plan.free:
            return (
                f"{said} The plan counts on this place, and the fit knows it to {fixture.prior_mm:g} mm (one sigma): "
                "what it is off beyond that goes into the robot."
            )
        return (
            f"{said} Within {near} is near enough: the fit finds where it truly stands. Further off the {noun} may "
            "come to its end or touch something on the way; then write the true place into the cell and plan again."
        )

    def _tool_text(self, file: CellFile, tool: ToolFile) -> str:
        """Say where the measured point sits in the flange."""
        x, y, z = tool.map_mm
        sigma = tool.prior_mm if tool.map_sigma_um is None else float(to_mm(tool.map_sigma_um * UM))
        found = " and the fit finds it to better" if "tool" in file.plan.free else ""
        return (
            f"{self.tool} at {place_text(tool.map_mm)} of the flange frame: {z:g} mm out of the flange and "
            f"{hypot(x, y):.4g} mm beside its axis. The plan counts on it to {sigma:g} mm (one sigma){found}."
        )

    def _range_text(self, noun: str, length_mm: tuple[float, float]) -> str:
        shortest, longest = length_mm
        return (
            f"The {noun} reads {shortest:g} to {longest:g} mm {self.ends}; the middle of its range is "
            f"{(shortest + longest) / 2:g} mm."
        )

    @staticmethod
    def _zero_text(file: CellFile, noun: str, sigma: float) -> str:
        """Say how its zero is set, and whether it must be."""
        if file.gauge.zero == "known":
            return (
                f"Its zero must be right, the fit takes it for known: set the {noun} to the length of a master before "
                "the first pose, and check it there after the last."
            )
        return (
            f"Set its display to the length that the {noun} has then, by a master or a ruler, to {to_mm(sigma):g} mm: "
            "the fit finds the zero that is left. Do not set it again before the last pose."
        )


LOADED = BarChecklist(
    attach="with its load off, put one ball into the fixture's seat, the other into the tool's.",
    load=" Set a load only where the program asks for it; keep your hands away while it pulls.",
)
