"""Routes of certificates: issued here, frozen, shown with whether they still hold, and withdrawn."""

from typing import Annotated

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath
from fastapi.responses import HTMLResponse
from pydantic import Field

from planner.common.schema import StrictModel
from planner.service.certificate import (
    NUMBER,
    Certificate,
    CertificateFile,
    CertificateRequest,
    certificate_path,
    number_parts,
    read_certificate,
    read_certificate_withdrawal,
    withdraw_certificate,
    write_certificate,
)
from planner.service.certificate_content import build_certificate
from planner.service.certificate_pdf import certificate_pdf
from planner.service.context import Context, ServiceContext
from planner.service.login import is_secure
from planner.service.record_api import Reason
from planner.service.record_store import UnknownRecordError
from planner.service.rendering import ROOT, render

CERTIFICATES = APIRouter(tags=["certificates"])
Number = Annotated[str, InPath(pattern=f"^{NUMBER}$", description="of the certificate", examples=["KR6-0815-C01"])]


class IssuedCertificate(StrictModel):
    """A certificate as it was issued, and whether it still holds."""

    holds: bool
    fault: str = Field(description="why it holds no more; empty where it does")
    sha256: str = Field(description="of the content")
    url: str
    certificate: Certificate


@CERTIFICATES.post("/api/certificates", status_code=201)
def issue_certificate(body: CertificateRequest, request: Request, context: Context) -> IssuedCertificate:
    """Issue the certificate of a calibration for a use; what it says is frozen."""
    base = f"http{'s' if is_secure(request) else ''}://{request.url.netloc}{ROOT.get()}"
    context.records.index.refresh(now=True)
    with context.records.index.hold_alone():  # two that are issued at the same moment have two numbers
        folder, certificate = build_certificate(context, body, base)
        return _describe(context, write_certificate(folder, certificate))


@CERTIFICATES.get("/api/certificates/{number}")
def get_certificate(number: Number, context: Context) -> IssuedCertificate:
    """Get a certificate, and whether it still holds."""
    return find_certificate(context, number)


@CERTIFICATES.get("/api/certificates/{number}/pdf", response_class=Response)
def get_pdf(number: Number, context: Context) -> Response:
    """Get a certificate as PDF, one A4 sheet; where it holds no more, that is printed across it."""
    found = find_certificate(context, number)
    file = CertificateFile(sha256=found.sha256, certificate=found.certificate)
    named = {"content-disposition": f'inline; filename="{number}.pdf"'}
    return Response(certificate_pdf(file, found.fault), media_type="application/pdf", headers=named)


@CERTIFICATES.post("/api/certificates/{number}/withdrawal")
def withdraw(number: Number, body: Reason, context: Context) -> IssuedCertificate:
    """Withdraw a certificate with a reason; it stays, and says so."""
    find_certificate(context, number)
    with context.records.index.hold_alone():
        withdraw_certificate(context.records.path(number_parts(number)[0]), number, body.withdrawal)
    return find_certificate(context, number)


@CERTIFICATES.get("/certificates/{number}", include_in_schema=False, response_class=HTMLResponse)
def show_certificate(number: Number, context: Context) -> HTMLResponse:
    """Show a certificate, and before anything else whether it still holds."""
    found = find_certificate(context, number)
    return render("certificate", found=found, c=found.certificate, simulated=found.certificate.simulated)


def find_certificate(context: ServiceContext, number: str) -> IssuedCertificate:
    """Return a certificate with its state of today.

    Raises:
        UnknownRecordError: there is none of that number.
        InputError: it is not what was issued.
    """
    folder = context.records.path(number_parts(number)[0])
    if not certificate_path(folder, number).is_file():
        raise UnknownRecordError(f"there is no certificate {number}")
    context.records.index.refresh()
    return _describe(context, read_certificate(folder, number))


def _describe(context: ServiceContext, file: CertificateFile) -> IssuedCertificate:
    fault, url = _fault(context, file.certificate), f"/api/certificates/{file.certificate.number}"
    return IssuedCertificate(holds=not fault, fault=fault, sha256=file.sha256, url=url, certificate=file.certificate)


def _fault(context: ServiceContext, c: Certificate) -> str:
    """Return why a certificate holds no more: a person or its calibration, a newer one, or a check that failed."""
    said = read_certificate_withdrawal(context.records.path(c.serial), c.number)
    if said is not None:
        return f"{said.reason} ({said.date}{f', {said.by}' if said.by else ''})"
    return context.judge.standing_in(context.records.read(c.serial), c.entry, {c.document_sha256}, c).fault
