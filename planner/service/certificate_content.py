"""What a certificate says of a finished identification: gathered when it is issued, from its files and its record."""

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from planner import load_cell
from planner.cell.file import CellFile
from planner.cell.reading import gauge_class, read_cell_file
from planner.checks.record import AccuracyFile, Circumstances, RecordEntry, RobotRecord, read_document
from planner.common.schema import read_toml
from planner.common.units import to_mm
from planner.kinematics.robot_file import RobotDescription
from planner.model.identification_document import Identification, Metrics
from planner.model.use_text import TOOLS
from planner.service.callers import CALLER
from planner.service.certificate import (
    REGIONS,
    Certificate,
    CertificateRequest,
    ErrorRow,
    Fact,
    FactGroup,
    UncertifiedError,
    certificate_numbers,
    expanded_uncertainty,
    list_exclusions,
    number_parts,
    uncertainty_budget,
)
from planner.service.context import ServiceContext
from planner.service.file_api import robot_title
from planner.service.job_api import output_path
from planner.service.job_record import JobFilter, JobRecord

RMS_OF_REPEATABILITY = 3**0.5 / (1.5958 + 3 * 0.6734)
"""Rms distance by RP of ISO 9283 (mean distance plus three standard deviations), where the scatter is alike in space:
the distances then follow Maxwell's distribution."""
HASHED = ("identification.json", "robot.toml", "residuals.csv")


def build_certificate(context: ServiceContext, request: CertificateRequest, base: str) -> tuple[Path, Certificate]:
    """Return the folder of the robot's record, and the certificate as it would be issued now.

    ``base``: address of the service, to which that of the certificate is added.

    Raises:
        InputError: no robot's record has the calibration, it does not hold, or it states no error for the use.
    """
    job = context.jobs.get(request.job)
    outputs = {f.name: f.sha256 for f in context.jobs.outputs(job.id)}
    if job.kind != "identification" or "identification.json" not in outputs:
        raise UncertifiedError("only a finished identification has a certificate")
    standing, known = context.judge.standing(job.id), context.records.index.find_entry(set(outputs.values()))
    if not known.serial:
        raise UncertifiedError("no robot's record has this calibration: add it to the record of its robot first")
    if standing.fault:
        raise UncertifiedError(f"this calibration holds no more: {standing.fault}")
    record, folder = context.records.read(known.serial), context.records.path(known.serial)
    entry = next(e for e in record.entries if e.number == known.number)
    last = max((number_parts(n)[1] for n in certificate_numbers(folder)), default=0)
    number = f"{known.serial}-C{last + 1:02d}"
    return folder, _fill(context, request, job, outputs, record, entry, number, f"{base}/certificates/{number}")


def _fill(
    context: ServiceContext,
    request: CertificateRequest,
    job: JobRecord,
    outputs: dict[str, str],
    record: RobotRecord,
    entry: RecordEntry,
    number: str,
    address: str,
) -> Certificate:
    document = Identification.read_usable(context.files.path(outputs["identification.json"]))
    command, inputs = job.command, {i.name: i.sha256 for i in job.command.inputs}
    cell = _cell_file(context, str(command.option("--cell")), inputs)
    is_length = gauge_class(cell).columns == "length_mm"
    budget = uncertainty_budget(request, document, *_repeatability(context, outputs, document, is_length))
    remarks, validation = list(document.warnings), find_validation(context, outputs["robot.toml"])
    most = 4  # remarks on one sheet; the report has all
    left = len(remarks) - most
    more = [f"{left} more in the report of the calibration"] if left > 0 else []
    return Certificate(
        schema="edbb-certificate/1",
        number=number,
        serial=record.file.serial,
        job=job.id,
        entry=entry.number,
        last_entry=max(e.number for e in record.entries),
        document_sha256=outputs["identification.json"],
        issued=datetime.now(UTC).replace(microsecond=0),
        issued_by=CALLER.get().name,
        address=address,
        simulated=bool(document.simulated),
        use=f"{TOOLS[request.tool]}, at {REGIONS[request.region]}",
        groups=_groups(request, document, entry.file.circumstances, record.file.serial, _gauge(cell)),
        method=_method(document, _plan_id(context, command.option("--plan"), inputs)),
        results=[*_results(document), *_validation_rows(validation)],
        budget=budget,
        expanded_mm=expanded_uncertainty(budget),
        not_contained=list_exclusions(request, document),
        remarks=remarks[:most] + more,
        hashes=_hashes(inputs, outputs, job.version),
    )


def _groups(
    request: CertificateRequest, document: Identification, said: Circumstances, serial: str, gauge: str
) -> list[FactGroup]:
    degrees = "" if said.temperature_degC is None else f"{said.temperature_degC:g} °C"
    rows = {
        "Robot": (("Model", robot_title(document.robot)), ("Serial number", serial), ("Place", request.place)),
        "Gauge": (("Kind", gauge), ("Serial number", said.gauge), ("Its certificate", said.certificate)),
        "Conditions": (
            ("Measured on", said.date.isoformat()), ("Operator", said.operator), ("Temperature", degrees),
            ("Tool and load", said.tool), ("Approved by", request.approved_by),
        ),
    }  # fmt: skip
    return [
        FactGroup(title=title, facts=[Fact(what=what, value=value.strip() or "not stated") for what, value in facts])
        for title, facts in rows.items()
    ]


def _method(document: Identification, plan_id: str) -> str:
    """Say which readings the errors are of, how they were held out, and what was fitted and found."""
    d = document
    aside = f" {d.n_validation} validation readings took no part in any fit." if d.n_validation else ""
    plan = f" Poses are those of the plan {plan_id}." if plan_id else ""
    effects = ", ".join(d.stages[-1].effects)  # where nothing was found: those that cell and robot declare
    beyond = f"none beyond geometry{f' and {effects}, which the model holds' if effects else ''}"
    found = "; ".join(f.title for f in d.findings if not f.is_doubtful) or beyond
    return (
        f"{d.n_samples} readings at {d.n_groups} {d.split.groups}, in {round(1 / d.split.hold_out)} parts; “held out” "
        f"means that each part was predicted by a fit to the others.{aside}{plan} {len(d.last_fit)} parameters were "
        f"fitted; findings: {found}."
    )


def _plan_id(context: ServiceContext, name: str | None, inputs: dict[str, str]) -> str:
    plan = inputs.get(str(name))
    return "" if plan is None else str(json.loads(context.files.path(plan).read_bytes()).get("plan_id", ""))


def _hashes(inputs: dict[str, str], outputs: dict[str, str], version: str) -> list[Fact]:
    """What was measured and found, by SHA-256, and by which version of the planner."""
    measured = [(n, h) for n, h in inputs.items() if n.endswith((".csv", ".parquet", "plan.json"))]
    all_ = [*measured, *((n, h) for n, h in outputs.items() if n in HASHED)]
    kept = [Fact(what=n, value=h) for n, h in all_ if not n.endswith("trajectory.csv")]
    return [*kept, Fact(what="software", value=f"edbb {version}")]


def _validation_rows(validation: AccuracyFile | None) -> list[ErrorRow]:
    """Rows of a tracker's run by which the calibrated robot was judged."""
    if validation is None:
        return []
    both = (("before", validation.before), ("after", validation.after))
    return [
        ErrorRow(what=f"{name}, positions of {validation.run}", unit="mm", rms=None, mean=m.mean_mm, largest=m.max_mm)
        for name, m in both
        if m is not None
    ]


def find_validation(context: ServiceContext, robot_sha256: str) -> AccuracyFile | None:
    """Return the latest run of a tracker by which a calibrated robot was judged; ``None`` where there is none."""
    done = context.jobs.list_jobs(JobFilter("validation", "done"))
    mine = next((j for j in done if robot_sha256 in j.command.inputs_of("--model").values()), None)
    if mine is None:
        return None
    found = read_document(output_path(context, mine.id, "accuracy.json"), "validation")
    return found if isinstance(found, AccuracyFile) and found.after is not None else None


def _results(document: Identification) -> list[ErrorRow]:
    """Errors of readings held out, and of those of a validation where both robots have them."""
    after = document.release or document.stages[-1]
    both, unit = (("before", document.placed_stage), ("after", after)), document.reading_unit
    seen = [(f"{name}, validation run", s.validation) for name, s in both if s.validation is not None]

    def in_mm(size: float) -> float:
        """Return a size [m] in mm, or a thousandth of an angle."""
        return float(to_mm(size))

    rows: Sequence[tuple[str, Metrics]] = [(f"{name}, held out", s.held_out) for name, s in both]
    return [
        ErrorRow(what=what, unit=unit, rms=in_mm(m.rms), mean=in_mm(m.mean), largest=in_mm(m.largest))
        for what, m in (*rows, *(seen if len(seen) == len(both) else []))
    ]


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
    context: ServiceContext, outputs: dict[str, str], document: Identification, is_length: bool
) -> tuple[float, str]:
    """Return the scatter of the tool's position, rms in space [mm], and how it is known.

    It is of the run's own repeats, if it has any; else that of the repeatability which the robot's file publishes, or
    of an assumed one. A bar sees one axis of three; the scatter is taken for alike in space.
    """
    floor = document.noise_floor
    if floor is not None and document.reading_unit == "mm":
        in_space = float(to_mm(floor)) * (3.0 if is_length else 1.0) ** 0.5  # axes of space for each that is seen
        rp = in_space / RMS_OF_REPEATABILITY
        return in_space, f"repeated poses of this run: RP {rp:.3f} mm as in ISO 9283, gauge's scatter included"
    file = read_toml(context.files.path(outputs["robot.toml"]), RobotDescription)
    known = "as in" if "repeatability_mm" in file.model_fields_set else "assumed, for it is not in"
    return RMS_OF_REPEATABILITY * file.repeatability_mm, f"data sheet (RP of ISO 9283), {known} the robot's file; rms"
