"""What the pages of finished jobs say: numbers out of the documents that the commands have written."""

from planner.checks.record import DOCUMENTS
from planner.circular.document import CircularDocument
from planner.common.schema import PartialModel, read_json
from planner.common.units import MM
from planner.design.observability.information import find_rule
from planner.model.use_text import targets_text
from planner.report.formatting import duration_text
from planner.service.answers import Job, OutputFile
from planner.service.context import ServiceContext
from planner.service.job_api import output_path
from planner.session.document import PlanDocument, PlanHeader

HIDDEN = ("log", "printed", "manifest.json", "timings.json")


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
    shown = text.replace(" out/", " ")  # the folder of the job, which a person never sees
    lines = [line.rstrip() for line in shown.splitlines() if line.strip() and not line.startswith("{")]
    key = "  tool error  "
    return next((line.removeprefix(key) for line in lines if line.startswith(key)), ""), "\n".join(lines)


ROLES = {  # of poses: what is done there, and why
    "calibrate": ("poses to calibrate", ""),
    "repeat": ("measured again", ", for the repeatability"),
    "validate": ("poses to validate", ", at random, kept out of the fit: they show how good it is"),
    "mount": ("stops for the gauge", ", where it is made ready and taken off"),
}


def is_simulated(context: ServiceContext, job: Job) -> bool:
    """Tell whether a finished job is made of readings that nobody measured."""
    if job.kind == "simulation" or job.request.get("simulation"):
        return True
    documents = [context.files.path(f.sha256) for f in job.files if f.name in DOCUMENTS]
    found = [read_json(path) for path in documents]
    return any(isinstance(d, dict) and d.get("simulated") is True for d in found)


def visible_files(job: Job) -> list[OutputFile]:
    """Return the files that a page lists: those for people, without the machine's notes."""
    return [f for f in job.files if f.name not in HIDDEN]


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
    if (e := plan.foresight) is not None and e.within_mm is not None and e.within_before_mm is not None:
        text = targets_text(e.within_mm * MM, e.within_before_mm * MM, "such robots")
        rows.insert(0, ("expected", f"{text}, 95 % sure"))
    elif e is not None and e.error_mm is not None:
        rows.append(("error to be expected", f"{_digits(e.error_mm)} mm"))
    return rows


def _digits(value: object) -> str:
    return f"{float(value):.3g}" if isinstance(value, int | float) else str(value)
