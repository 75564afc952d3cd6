"""Sheets to print: the certificate of a calibration, and what to do at the cell from an empty one to a saved log."""

import json
from pathlib import Path

from planner import load_cell
from planner.cell.file import CellFile
from planner.cell.reading import gauge_class
from planner.cell.sections import read_cell_file
from planner.checks.record import AccuracyFile
from planner.common.schema import read_json, read_toml, validate
from planner.common.units import to_mm
from planner.kinematics.robot_file import RobotDescription
from planner.model.identification_document import Identification, Metrics
from planner.service.answers import Job, OutputFile
from planner.service.context import ServiceContext
from planner.service.file_api import robot_title
from planner.service.job_api import output_path
from planner.service.job_filter import JobFilter
from planner.service.page_content import AnyPlan, CalibrationPage, is_simulated
from planner.service.record_api import find_record_entry

RMS_OF_REPEATABILITY = 3**0.5 / (1.5958 + 3 * 0.6734)
"""Rms distance by RP of ISO 9283 (mean distance plus three standard deviations), where the scatter is alike in space:
the distances then follow Maxwell's distribution."""
SPACE_AXES = 3  # axes of a place in space
HASHED = ("identification.json", "robot.toml", "residuals.csv")


def certificate_content(context: ServiceContext, job: Job) -> dict[str, object]:
    """Return what the certificate of a finished identification says beside the fields that a person fills in.

    Raises:
        InputError: its files are not what they should be.
    """
    record, outputs = context.jobs.get(job.id), {f.name: f.sha256 for f in job.files}
    found = CalibrationPage(Identification.read_usable(context.files.path(outputs["identification.json"])))
    inputs = {i.name: i.sha256 for i in record.command.inputs}
    plan = inputs.get(str(record.command.option("--plan")))
    measured = {n: h for n, h in inputs.items() if n.endswith((".csv", ".parquet", "plan.json"))}
    hashes = [*measured.items(), *((f.name, f.sha256) for f in job.files if f.name in HASHED)]
    cell = _cell_file(context, str(record.command.option("--cell")), inputs)
    width = 1 if gauge_class(cell).columns == "length_mm" else SPACE_AXES
    scatter, rp, published = _repeatability(context, job, found, width)
    return {
        "found": found,
        "model": robot_title(found.document.robot),
        "simulated": is_simulated(context, job),
        "recorded": find_record_entry(context, job.id),
        "gauge": _gauge(cell),
        "plan_id": "" if plan is None else str(json.loads(context.files.path(plan).read_bytes()).get("plan_id", "")),
        "fitted": len(found.document.last_fit),
        "results": _results(found),
        "validation": find_validation(context, outputs["robot.toml"]),
        "repeatability_mm": scatter,
        "measured_rp_mm": rp,
        "published_repeatability": published,
        "hashes": [(name, sha256) for name, sha256 in hashes if not name.endswith("trajectory.csv")],
        "software": record.version,
    }


def find_validation(context: ServiceContext, robot_sha256: str) -> AccuracyFile | None:
    """Return the latest run of a tracker by which a calibrated robot was judged; ``None`` where there is none."""
    done = context.jobs.list_jobs(JobFilter("validation", "done"))
    mine = next((j for j in done if robot_sha256 in j.command.inputs_of("--model").values()), None)
    if mine is None:
        return None
    path = output_path(context, mine.id, "accuracy.json")
    found = validate(read_json(path), AccuracyFile, str(path))
    return found if found.after is not None else None


def _results(found: CalibrationPage) -> list[tuple[str, Metrics]]:
    """Errors on the readings held out, and on those of a validation where both robots have them."""
    both = (("before", found.placed_stage), ("after", found.written_errors))
    seen = [(f"{name}, validation run", s.validation) for name, s in both if s.validation is not None]
    return [(f"{name}, held out", s.held_out) for name, s in both] + (seen if len(seen) == len(both) else [])


def _cell_file(context: ServiceContext, name: str, inputs: dict[str, str]) -> CellFile:
    """The cell that was identified in."""
    if name in inputs:
        return read_cell_file(context.files.path(inputs[name]))
    return load_cell(name, planning=False).file


def _gauge(file: CellFile) -> str:
    """The kind of gauge, with its range."""
    gauge = file.gauge
    span = f", {gauge.length_mm[0]:g} to {gauge.length_mm[1]:g} mm" if gauge.length_mm else ""
    return f"{gauge.kind}{span}"


def _repeatability(
    context: ServiceContext, job: Job, found: CalibrationPage, width: int
) -> tuple[float, float | None, str]:
    """Return the scatter of the tool's position, rms in space, and RP [mm]: of the run's own repeats, if it has any.

    Without repeats the scatter is that of the repeatability which the robot's file publishes, or of an assumed one; a
    text says which. A bar sees one axis of three; the scatter is taken for alike in space.
    """
    floor = found.document.noise_floor
    if floor is not None and found.document.reading_unit == "mm":
        in_space = float(to_mm(floor)) * (SPACE_AXES / min(width, SPACE_AXES)) ** 0.5
        return in_space, in_space / RMS_OF_REPEATABILITY, ""
    file = read_toml(output_path(context, job.id, "robot.toml"), RobotDescription)
    known = "as in" if "repeatability_mm" in file.model_fields_set else "assumed, for it is not in"
    return RMS_OF_REPEATABILITY * file.repeatability_mm, None, f"data sheet (RP of ISO 9283), {known} the robot's file"


def session_content(plan: AnyPlan, cell: CellFile, files: list[OutputFile]) -> dict[str, object]:
    """Return what the checklist from an empty cell to a saved log says of a plan; files of a program share its name."""
    stems, gauge = tuple(Path(p.file).stem for p in plan.programs), gauge_class(cell)
    return {
        "plan": plan,
        "guide": gauge.session_guide(cell),
        "reading": gauge.reading_text(cell),
        "by_hand": cell.gauge.read_by == "hand" and gauge.columns == "length_mm",
        "programs": [f for f in files if f.name.startswith(stems)],
        "static": cell.motion.measure == "static",
    }
