"""The certificate of a calibration: what it says is frozen when it is issued, with a hash over all of it.

``certificates/NUMBER.json`` in the folder of a robot's record holds it; ``NUMBER.withdrawn.json`` why it holds no more,
where a person has said so.
"""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from planner.checks.record import Withdrawal
from planner.common.errors import InputError
from planner.common.files import document_text, text_hash, write_text
from planner.common.schema import Statement, StrictModel, read_json, validate
from planner.common.units import MM, to_mm
from planner.model.identification_document import Identification, Release
from planner.model.use_statement import ToolName
from planner.model.use_text import TOOLS, bound_text
from planner.service.job_folder import JobId

COVERAGE = 2.0
"""Factor k of the expanded uncertainty: about 95 of 100 targets (GUM, 6.2.2)."""
WITHIN_95_OF_RMS = 2.7955 / 3**0.5
"""Distance that 95 of 100 places stay within, by their rms distance, where the scatter is alike in space (Maxwell)."""
NUMBER = r"[A-Za-z0-9][A-Za-z0-9._-]{0,60}-C[0-9]{2,4}"
Region = Literal["workspace", "run"]
REGIONS: dict[Region, str] = {"workspace": "any pose of the workspace", "run": "poses like those of the run"}
Uncertainty = Annotated[float, Field(ge=0, le=100, strict=True), AfterValidator(abs)]  # -0 is 0


class CertificateRequest(StrictModel):
    """What a person states when a certificate is issued; standard uncertainties in mm, none where nobody knows it."""

    job: JobId = Field(description="the identification")
    tool: ToolName = Field("measured", description="with which tool the robot works")
    region: Region = Field("workspace", description="where it works")
    place: Statement = ""
    approved_by: Statement = ""
    u_gauge_mm: Uncertainty | None = Field(None, description="of the gauge's own calibration, at the robot's reach")
    u_temperature_mm: Uncertainty | None = Field(None, description="of the change of temperature, calibration to work")
    u_base_mm: Uncertainty | None = Field(None, description="of how the cell's frame was found")


STATED = (  # fields of the request, what they are, and where a person knows them from
    ("u_gauge_mm", "Gauge's own calibration", "its certificate, at the robot's reach"),
    ("u_temperature_mm", "Temperature", "change from calibration to work, times the arm's growth"),
    ("u_base_mm", "Base alignment", "how the cell's frame was found"),
)


class Fact(StrictModel):
    """A line of a group of facts."""

    what: str
    value: str


class FactGroup(StrictModel):
    """Facts under one title."""

    title: str
    facts: list[Fact]


class Contribution(StrictModel):
    """A standard uncertainty, what it is of, and how it is known."""

    what: str
    known_from: str
    u_mm: float


class ErrorRow(StrictModel):
    """Errors of one kind."""

    what: str
    unit: str
    rms: float | None
    mean: float
    largest: float


class Certificate(StrictModel):
    """A certificate as it was issued."""

    schema_: Literal["edbb-certificate/1"] = Field(alias="schema")
    number: str
    serial: str
    job: str
    entry: int = Field(description="of the calibration in the robot's record")
    last_entry: int = Field(description="of the record when it was issued")
    document_sha256: str
    issued: datetime
    issued_by: str
    address: str = Field(description="where it is said whether it still holds")
    simulated: bool
    use: str
    groups: list[FactGroup]
    method: str
    results: list[ErrorRow]
    budget: list[Contribution]
    expanded_mm: float
    not_contained: list[str]
    remarks: list[str]
    hashes: list[Fact]

    @property
    def expanded_text(self) -> str:
        """The expanded uncertainty with two digits, rounded up (GUM, 7.2.6)."""
        return bound_text(self.expanded_mm * MM)

    @property
    def title(self) -> str:
        """What stands at the head of the sheet."""
        return "Simulated: no certificate" if self.simulated else "Certificate of calibration"


class CertificateFile(StrictModel):
    """A certificate and the SHA-256 of its content."""

    sha256: str
    certificate: Certificate


class UncertifiedError(InputError):
    """A calibration for which no certificate is issued."""


class ClaimError(InputError):
    """A use is named for which this calibration states no error."""


def model_errors(document: Identification) -> dict[ToolName, tuple[float, str]]:
    """Return what 95 of 100 targets stay within [m] with each tool, over the workspace, and how that is known."""
    sure = "95 of 100 targets within {}, 95 % sure; half of it"
    if document.use is not None:
        return {t.tool: (t.targets_within, sure.format(bound_text(t.targets_within))) for t in document.use.tools}
    about = "rms {} over the workspace, 95 % sure, as 95 of 100 targets; half of it"
    out: dict[ToolName, tuple[float, str]] = {}
    if (r := document.release) is not None:
        ratio = _limit_ratio(document, r)
        rms: dict[ToolName, float] = {"measured": r.at_most, "another": r.other_tool * ratio}
        if r.work_tool is not None:
            rms["own"] = r.work_tool.anywhere * ratio
        out = {tool: (WITHIN_95_OF_RMS * v, about.format(bound_text(v))) for tool, v in rms.items()}
    elif document.workspace_error:
        likely = f"rms {bound_text(document.workspace_error)} over the workspace, as likely exceeded as not"
        out = {"measured": (WITHIN_95_OF_RMS * document.workspace_error, likely)}
    if (summary := document.summary) is not None and summary.targets_within is not None:
        out[summary.tool] = (summary.targets_within, sure.format(bound_text(summary.targets_within)))
    return out


def _limit_ratio(document: Identification, release: Release) -> float:
    """Return the 95 % limit over the stated error, which other stated errors are taken times."""
    return release.at_most / document.workspace_error if document.workspace_error else 1.0


def error_of_use(document: Identification, tool: ToolName, region: Region) -> tuple[float, str]:
    """Return what 95 of 100 targets of a use stay within [m], and how that is known.

    Raises:
        ClaimError: the calibration says nothing of it.
    """
    known = model_errors(document)
    if tool not in known:
        there = " or ".join(TOOLS[t] for t in known) or "no tool"
        raise ClaimError(f"this calibration states no error with {TOOLS[tool]}; it states one with {there}")
    if region == "workspace":
        return known[tool]
    r = document.release
    if tool != "measured" or r is None or r.where_measured is None:
        raise ClaimError("for poses like those of the run an error is stated with the measured tool alone, if at all")
    rms = r.where_measured * _limit_ratio(document, r)
    return WITHIN_95_OF_RMS * rms, f"rms {bound_text(rms)} at poses of the run, 95 % sure, as 95 of 100; half of it"


def uncertainty_budget(
    request: CertificateRequest, document: Identification, repeatability_mm: float, repeatability_from: str
) -> list[Contribution]:
    """Return the contributions of a use: standard uncertainties, added as squares (GUM, 5.1.2).

    Raises:
        ClaimError: the calibration states no error for this use.
    """
    bound, known_from = error_of_use(document, request.tool, request.region)
    rows = [
        Contribution(what="Calibrated model", known_from=known_from, u_mm=float(to_mm(bound)) / COVERAGE),
        Contribution(what="Repeatability of the robot", known_from=repeatability_from, u_mm=repeatability_mm),
    ]
    for field, what, source in STATED:
        if (value := getattr(request, field)) is not None:
            rows.append(Contribution(what=what, known_from=source, u_mm=value))
    return rows


def expanded_uncertainty(rows: list[Contribution]) -> float:
    """Return the expanded uncertainty of a budget [mm]."""
    return float(COVERAGE * sum(r.u_mm**2 for r in rows) ** 0.5)


def list_exclusions(request: CertificateRequest, document: Identification) -> list[str]:
    """Return what the expanded uncertainty does not contain, with the figure where it is known."""
    open_ = [what.lower() for field, what, _ in STATED if getattr(request, field) is None]
    out = [f"what nobody has stated: {', '.join(open_)}"] if open_ else []
    known = model_errors(document)
    for tool in ("measured", "own", "another"):
        if tool == request.tool or (tool == "measured" and request.tool == "own"):
            continue
        if tool in known:
            out.append(f"{TOOLS[tool]}: 95 of 100 targets are within {bound_text(known[tool][0])} by the model alone")
        elif tool == "another":
            out.append(f"{TOOLS[tool]}: this calibration states no error for it")
    if request.region == "run" and request.tool in known:
        out.append(f"poses elsewhere: 95 of 100 targets are within {bound_text(known[request.tool][0])} by the model")
    warmth = "for an arm as warm as in this run"
    if document.release is not None:
        warmth = document.release.warmth_text.partition("; ")[0]
    out.append(f"another warmth or load of the arm: U is {warmth}")
    if document.release is not None:
        out += [f"{u.what} ({u.cure} would show it)" for u in document.release.not_shown[:2]]
    return out


def certificate_path(record: Path, number: str) -> Path:
    """Return where a certificate lies in the folder of a record."""
    return record / "certificates" / f"{number}.json"


def write_certificate(record: Path, certificate: Certificate) -> CertificateFile:
    """Write a certificate with its hash; there is none of that number yet."""
    path = certificate_path(record, certificate.number)
    path.parent.mkdir(exist_ok=True)
    file = CertificateFile(sha256=_hash_of(certificate), certificate=certificate)
    write_text(path, document_text(file.model_dump(mode="json", by_alias=True)))
    return file


def read_certificate(record: Path, number: str) -> CertificateFile:
    """Read a certificate.

    Raises:
        InputError: it is not what was issued.
    """
    path = certificate_path(record, number)
    file = validate(read_json(path), CertificateFile, str(path))
    if _hash_of(file.certificate) != file.sha256:
        raise InputError(f"the certificate {number} is not what was issued: its hash differs; fetch it from a backup")
    return file


def number_parts(number: str) -> tuple[str, int]:
    """Return the serial number and the count of which the number of a certificate is made."""
    serial, _, count = number.rpartition("-C")
    return serial, int(count)


def certificate_numbers(record: Path) -> list[str]:
    """Return the numbers of the certificates of a record, the oldest first."""
    found = (p.name.removesuffix(".json") for p in (record / "certificates").glob("*-C*.json"))
    return sorted((n for n in found if not n.endswith(".withdrawn")), key=lambda n: number_parts(n)[1])


def withdraw_certificate(record: Path, number: str, withdrawal: Withdrawal) -> None:
    """Keep why a certificate holds no more; the first reason stays."""
    path = certificate_path(record, f"{number}.withdrawn")
    if not path.is_file():
        write_text(path, document_text(withdrawal.model_dump(mode="json")))


def read_certificate_withdrawal(record: Path, number: str) -> Withdrawal | None:
    """Return why a person has withdrawn a certificate; ``None`` where nobody has."""
    path = certificate_path(record, f"{number}.withdrawn")
    return validate(read_json(path), Withdrawal, str(path)) if path.is_file() else None


def _hash_of(certificate: Certificate) -> str:
    return text_hash(document_text(certificate.model_dump(mode="json", by_alias=True)).encode())
