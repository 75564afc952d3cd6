"""What the pages of finished jobs say: numbers out of the documents that the commands have written."""

from dataclasses import dataclass
from pathlib import Path

from planner.checks.record import DOCUMENTS
from planner.circular.document import CircularDocument
from planner.common.schema import PartialModel, read_json
from planner.common.units import to_mm
from planner.design.observability.information import find_rule
from planner.model.finding import Finding
from planner.model.identification_document import Identification, Release, Stage
from planner.model.use_text import Row, bound_text, use_head, use_rows, verdict_text
from planner.report.formatting import duration_text
from planner.service.answers import Job, OutputFile
from planner.service.context import ServiceContext
from planner.service.job_api import output_path
from planner.session.document import PlanDocument, PlanHeader

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
    """Return the action that a person takes about an effect of this name."""
    name = effect.lower()
    return next((text for words, text in ACTIONS if any(w in name for w in words)), GENERAL)


HIDDEN = ("log", "printed", "manifest.json", "timings.json")
CAPTIONS = {  # of the pictures that reports have
    "index_curve": "Observability against the number of poses",
    "foresight": "Error to be expected against the number of poses",
    "funnel": "Candidates that are left after each check",
    "parameters": "How surely each parameter will be known",
    "tour": "Order of the poses",
    "joints": "Joint angles over time",
    "bar": "Length of the bar over time",
    "speeds": "Speeds of the axes over time",
    "by_stage": "Error after each stage of the fit",
    "by_pose": "Error of each pose",
    "histogram": "Error before and after",
    "expected_error": "Error to be expected over the workspace",
    "residual_joints": "Error that is left against the joint angles",
    "residual_gauge": "Error that is left against where the gauge reads",
    "residual_approach": "Error that is left, by the side from which each joint came to the pose",
    "residual_loads": "Error that is left against the load on each joint",
    "residual_circumstances": "Error that is left against time, temperature and the like",
    "correlation": "Which parameters are known only together",
    "misfit": "Misfit: what causes without a name leave open",
    "history": "What the poses were worth",
}


@dataclass(frozen=True)
class Picture:
    """A picture that a job has written."""

    url: str
    caption: str


class ForeseenChange(PartialModel):
    """A change, and the least motion of the tool [mm] from which a check shows it; none where it never does."""

    change: str
    detectable_mm: float | None


class CheckForecastFile(PartialModel):
    """What the page of a planned check needs of ``shows.json``."""

    false_alarm: float
    power: float
    hidden_because: str = ""
    changes: tuple[ForeseenChange, ...]


def correction_text(context: ServiceContext, job: Job) -> tuple[str, str]:
    """Return the error that is expected of a corrected program, and all that its command has said, line by line."""
    said = [f for f in job.files if f.name in ("printed", "log")]
    text = "\n".join(context.files.path(f.sha256).read_text(encoding="utf-8", errors="replace") for f in said)
    lines = [line.rstrip() for line in text.splitlines() if line.strip() and not line.startswith("{")]
    key = "  tool error  "
    return next((line.removeprefix(key) for line in lines if line.startswith(key)), ""), "\n".join(lines)


ROLES = {  # of poses: what is done there, and why
    "calibrate": ("poses to calibrate", ""),
    "repeat": ("measured again", ", for the repeatability"),
    "validate": ("poses to validate", ", at random, kept out of the fit: they show how good it is"),
    "mount": ("stops for the gauge", ", where it is made ready and taken off"),
}


Errors = Stage | Release
"""What a stage of the fit, or the robot that is written, leaves of the readings."""


@dataclass(frozen=True)
class CalibrationPage:
    """What the page of a calibration shows of its document."""

    document: Identification

    @property
    def placed_stage(self) -> Stage:
        """The robot of its data sheet, only the gauge placed on it."""
        return self.document.placed_stage

    @property
    def written_errors(self) -> Errors:
        """The robot that is written."""
        return self.document.release or self.document.stages[-1]

    @property
    def stages(self) -> list[tuple[str, int | None, Errors]]:
        """Name, number of parameters and errors of every stage, and of the robot that is written."""
        rows: list[tuple[str, int | None, Errors]] = [(s.name, s.parameters, s) for s in self.document.stages]
        return rows if self.document.release is None else [*rows, ("calibrated", None, self.document.release)]

    @property
    def verdict(self) -> str:
        """Say for what the robot is good enough, as its report does; of an older document by the error it keeps."""
        if (summary := self.document.summary) is not None:
            return f"{summary.headline}. {summary.because}"
        if self.document.use is not None:
            return verdict_text(self.document.use)
        if (r := self.document.release) is None:
            return "No robot was written: this calibration must not be used."
        other = (
            f"a tool point that was not measured is about {bound_text(r.other_tool)} off"
            if r.work_tool is None
            else f"the tool that it works with is about {bound_text(r.work_tool.anywhere)} off"
        )
        return (
            f"Over the workspace the measured tool errs by less than {bound_text(r.at_most)} (rms, 95 % sure); {other}."
        )

    @property
    def use_table(self) -> tuple[Row, list[Row]] | None:
        """Head and rows of what the robot is good for, where a tolerance was asked for."""
        use = self.document.use
        return None if use is None else (use_head(use), use_rows(use))

    @property
    def titles(self) -> str:
        """What was found, and where."""
        return "; ".join(f.title for f in self.document.findings if not f.is_doubtful)

    @property
    def modelled_effects(self) -> str:
        """Name the effects of the last fit: where nothing was found, those that cell and robot declare."""
        return ", ".join(self.document.stages[-1].effects)

    @property
    def readings(self) -> str:
        """Say which readings the errors are of, and how they were held out."""
        d = self.document
        folds = round(1 / d.split.hold_out)
        aside = f" {d.n_validation} validation readings took no part in any fit." if d.n_validation else ""
        return (
            f"{d.n_samples} readings at {d.n_groups} {d.split.groups}, in {folds} parts; “held out” means that each "
            f"part was predicted by a fit to the others.{aside}"
        )


def is_simulated(context: ServiceContext, job: Job) -> bool:
    """Tell whether a finished job is made of readings that nobody measured."""
    if job.kind == "simulation" or job.request.get("simulation"):
        return True
    documents = [context.files.path(f.sha256) for f in job.files if f.name in DOCUMENTS]
    found = [read_json(path) for path in documents]
    return any(isinstance(d, dict) and d.get("simulated") is True for d in found)


def visible_files(job: Job) -> list[OutputFile]:
    """Return the files that a page lists: those for people, without pictures and the machine's notes."""
    return [f for f in job.files if f.name not in HIDDEN and not f.name.startswith("pictures/")]


def pictures(job: Job) -> list[Picture]:
    """Return the pictures of a job's report."""
    found = [f for f in job.files if f.name.endswith(".png") and Path(f.name).stem != "view"]
    order = list(CAPTIONS.values())
    shown = [Picture(f.url, _caption(Path(f.name).stem)) for f in found]
    return sorted(shown, key=lambda p: order.index(p.caption) if p.caption in order else len(order))


AnyPlan = PlanDocument | CircularDocument
PLANS = ("plan", "check-plan")  # kinds of jobs whose folder holds a plan


def read_plan_document(context: ServiceContext, job: Job) -> AnyPlan:
    """Return the plan that a job has written."""
    content = read_json(output_path(context, job.id, "plan.json"))
    header = PlanHeader.model_validate(content)
    return (CircularDocument if header.kind == "circular" else PlanDocument).model_validate(content)


def plan_facts(plan: AnyPlan, is_check: bool = False) -> list[tuple[str, str]]:
    """Return the facts that a person asks of a plan first."""
    if isinstance(plan, CircularDocument):
        rows = [("circles", str(len(plan.circles)))]
    else:
        roles = ROLES | ({"calibrate": ("poses", ", to tell what has changed")} if is_check else {})
        rows = [(what, f"{n}{why}") for role, (what, why) in roles.items() if (n := len(plan.ids(role)))]
        rows += [] if is_check else _what_it_tells(plan)
    if plan.trajectory is not None:
        rows.append(("driving", f"{duration_text(plan.trajectory.duration_s)}, with the stops and the readings"))
    if plan.path.clearance_mm is not None:
        rows.append(("clearance", f"{_digits(plan.path.clearance_mm)} mm, proven along the whole path"))
    return [*rows, ("plan", plan.plan_id)]


def _what_it_tells(plan: PlanDocument) -> list[tuple[str, str]]:
    """What the poses will tell."""
    seen = plan.observability
    rows = [("parameters", f"{len(plan.parameters)} can be told apart, {len(plan.dropped)} cannot")]
    if seen.index:
        value, bound = _digits(seen.indices().get(seen.index)), _digits(seen.bound)
        way = "larger" if find_rule(seen.index).maximise else "smaller"
        text = f"{value} ({way} is better); no choice of as many poses has better than {bound}"
        rows.append((f"index {seen.index} in m, rad", text))
    if plan.foresight is not None and plan.foresight.error_mm is not None:
        rows.append(("error to be expected", f"{_digits(plan.foresight.error_mm)} mm"))
    return rows


def finding_size(finding: Finding, reading_unit: str) -> str:
    """Say how large a finding is, in the unit in which the file writes it, and what it brings to readings."""
    written = finding.model_dump(mode="json", by_alias=True)
    value, many = float(written["value"]), [abs(float(m["value"])) for m in written.get("members") or ()]
    std = "" if not finding.std else f" ± {_digits(value * finding.std / finding.value if finding.value else 0.0)}"
    better = f"{_digits(to_mm(finding.gain))} {reading_unit} better"
    gain = f"{better}, too faint for a stage of its own" if finding.beside_stages else f"{better} on poses held out"
    if many:  # the deviation is that of what they have in common, not of any one of them
        size = f"{_digits(min(many))} to {_digits(max(many))} {written['unit']} (root mean square {_digits(value)})"
        return f"{size}; {gain}, the one that brings most alone"
    return f"{_digits(value)}{std} {written['unit']}; {gain}"


def _caption(stem: str) -> str:
    base = stem.rstrip("0123456789").rstrip("_")
    return CAPTIONS.get(stem) or CAPTIONS.get(base) or stem.replace("_", " ").capitalize()


def _digits(value: object) -> str:
    return f"{float(value):.3g}" if isinstance(value, int | float) else str(value)
