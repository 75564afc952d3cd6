"""Routes of certificates: issued here, frozen, shown with whether they still hold, and withdrawn.

A certificate as PDF: one A4 sheet, whatever it says, with the address where it is said whether it still holds.
"""

from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any
from xml.sax.saxutils import escape

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath
from fastapi.responses import HTMLResponse
from pydantic import Field

from planner.common.schema import StrictModel
from planner.service.certificate import (
    COVERAGE,
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
from planner.service.context import Context, ServiceContext
from planner.service.login import is_secure
from planner.service.record_api import Reason
from planner.service.record_store import RecordConflictError, UnknownRecordError
from planner.service.rendering import ROOT, render

FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
RED, SOFT, DARK = "#a3201d", "#4b5763", "#12324a"
WIDE_MM = 182.0  # of an A4 sheet between its margins


def certificate_pdf(file: CertificateFile, fault: str) -> bytes:
    """Return the sheet; ``fault``: why the certificate holds no more, which is then printed across it."""
    from reportlab.lib.units import mm
    from reportlab.pdfgen.canvas import Canvas
    from reportlab.platypus import Frame, KeepInFrame

    _register_fonts()
    out, c = BytesIO(), file.certificate
    canvas = Canvas(out, pagesize=(210 * mm, 297 * mm), invariant=1)
    canvas.setTitle(f"{c.title} {c.number}")
    canvas.setAuthor("edbb")
    for is_so, text, turn in ((c.simulated, "SIMULATED", 50), (fault, "WITHDRAWN", -50)):
        if is_so:
            _print_across(canvas, text, turn)
    margin = (210 - WIDE_MM) / 2  # [mm], as those below
    wide, high = WIDE_MM * mm, (297 - 2 * margin) * mm
    whole = KeepInFrame(wide, high, _story(file, fault), mode="shrink")
    Frame(margin * mm, margin * mm, wide, high, 0, 0, 0, 0).addFromList([whole], canvas)
    canvas.showPage()
    canvas.save()
    return out.getvalue()


@cache
def _register_fonts() -> None:
    """Make the letters of matplotlib known, which have the signs of mathematics."""
    import matplotlib
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name in (FONT, BOLD):
        pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))
    pdfmetrics.registerFontFamily(FONT, normal=FONT, bold=BOLD, italic=FONT, boldItalic=BOLD)


def _print_across(canvas: Any, text: str, turn: float) -> None:
    from reportlab.lib.colors import HexColor
    from reportlab.lib.units import mm

    canvas.saveState()
    canvas.setFillColor(HexColor(RED), alpha=0.16)
    canvas.setFont(BOLD, 84)
    canvas.translate(105 * mm, 148 * mm)
    canvas.rotate(turn)
    canvas.drawCentredString(0, 0, text)
    canvas.restoreState()


def _paragraph(text: str, size: float = 8.0, bold: bool = False, right: bool = False, colour: str = "#1d232a") -> Any:
    from reportlab.lib.enums import TA_LEFT, TA_RIGHT
    from reportlab.lib.styles import ParagraphStyle
    from reportlab.pdfbase import pdfmetrics
    from reportlab.platypus import Paragraph

    style = ParagraphStyle(
        "text", fontName=BOLD if bold else FONT, fontSize=size, leading=1.28 * size, textColor=colour,
        alignment=TA_RIGHT if right else TA_LEFT, splitLongWords=1, wordWrap=None,
    )  # fmt: skip
    known = pdfmetrics.getFont(FONT).face.charToGlyph  # what the letters lack is spelt out, as the page has it
    shown = "".join(c if ord(c) in known else c.encode("unicode_escape").decode() for c in text)
    return Paragraph(escape(shown), style)


def _table(rows: list[list[Any]], widths_mm: list[float], lined: bool = True) -> Any:
    from reportlab.lib.units import mm
    from reportlab.platypus import Table, TableStyle

    style: list[Any] = [("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (0, -1), 0)]
    style += [(f"{side}PADDING", (0, 0), (-1, -1), 1.5) for side in ("TOP", "BOTTOM")]
    if lined:
        style.append(("LINEBELOW", (0, 0), (-1, -1), 0.25, "#c9d1d8"))
    return Table(rows, [w * mm for w in widths_mm], style=TableStyle(style), hAlign="LEFT")


def _heading(text: str) -> Any:
    from reportlab.platypus import Spacer

    return [Spacer(1, 5), _paragraph(text, 9.5, bold=True, colour=DARK)]


def _story(file: CertificateFile, fault: str) -> list[Any]:
    """Return what stands on the sheet, from the top."""
    from reportlab.platypus import Spacer

    c = file.certificate
    story = [_head(c), Spacer(1, 4)]
    if fault:
        story += [_paragraph(f"Withdrawn: {fault}.", 9.5, bold=True, colour=RED), Spacer(1, 3)]
    columns = [
        [
            _paragraph(g.title, 9.5, bold=True, colour=DARK),
            _table([[_paragraph(f.what, colour=SOFT), _paragraph(f.value)] for f in g.facts], [22, 36], False),
        ]
        for g in c.groups
    ]
    story.append(_table([columns], [WIDE_MM / len(columns)] * len(columns), lined=False))
    story += [*_heading("Method"), _paragraph(c.method)]
    head = [_paragraph(t, 7.5, colour=SOFT, right=k > 0) for k, t in enumerate(("Error", "rms", "mean", "largest"))]
    rows = [
        [_paragraph(f"{r.what}, {r.unit}")]
        + [_paragraph("" if v is None else f"{v:.3f}", right=True) for v in (r.rms, r.mean, r.largest)]
        for r in c.results
    ]
    story += [*_heading("Results"), _table([head, *rows], [WIDE_MM - 66, 22, 22, 22])]
    story += _budget(c)
    story += [*_heading("Not contained in U"), *(_paragraph(f"• {text}") for text in c.not_contained)]
    if c.remarks:
        story += [*_heading("Remarks"), *(_paragraph(f"• {text}", 7.5) for text in c.remarks)]
    hashes = [*((f.what, f.value) for f in c.hashes), ("this certificate", file.sha256)]
    rows = [[_paragraph(what, 6.5), _paragraph(value, 6.5)] for what, value in hashes]
    story += [*_heading("Traceability of the data (SHA-256)"), _table(rows, [40, WIDE_MM - 40])]
    signed = [[_paragraph("Calibrated by", colour=SOFT), _paragraph("Approved by", colour=SOFT)]]
    story += [Spacer(1, 22), _table(signed, [WIDE_MM / 2, WIDE_MM / 2])]
    return story


def _head(c: Certificate) -> Any:
    from reportlab.graphics.barcode.qr import QrCodeWidget
    from reportlab.graphics.shapes import Drawing
    from reportlab.lib.units import mm

    side = 26.0  # of the code [mm]
    code = QrCodeWidget(c.address, barWidth=side * mm, barHeight=side * mm, barBorder=0)
    drawing = Drawing(side * mm, side * mm)
    drawing.add(code)
    by = f" by {c.issued_by}" if c.issued_by else ""
    lines = [
        _paragraph(c.title, 16, bold=True, colour=RED if c.simulated else "#12324a"),
        _paragraph(f"Number {c.number}, issued {c.issued:%Y-%m-%d %H:%M} UTC{by}", 9),
        _paragraph(f"Whether it still holds: {c.address}"),
    ]
    if c.simulated:
        lines.append(
            _paragraph("Nobody has measured this robot: no figure here is true of a real one.", bold=True, colour=RED)
        )
    return _table([[lines, drawing]], [WIDE_MM - side - 4, side + 4])


def _budget(c: Certificate) -> list[Any]:
    head = [
        _paragraph(t, 7.5, colour=SOFT, right=k == 2) for k, t in enumerate(("Contribution", "Known from", "u, mm"))
    ]
    rows = [[_paragraph(r.what), _paragraph(r.known_from), _paragraph(f"{r.u_mm:.3f}", right=True)] for r in c.budget]
    total = [
        _paragraph(f"Expanded uncertainty U (k = {COVERAGE:g})", 9, bold=True),
        _paragraph(f"for {c.use}", 9, bold=True),
        _paragraph(c.expanded_text.removesuffix(" mm"), 9, bold=True, right=True),
    ]
    about = (
        "Of the tool's position where a program corrected by this calibration drives: distance in space that about 95 "
        "of 100 targets stay within. Standard uncertainties, added as squares (GUM, 5.1.2)."
    )
    return [*_heading("Uncertainty"), _paragraph(about), _table([head, *rows, total], [62, WIDE_MM - 84, 22])]


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
    context.records.index.refresh(now=True)
    with context.records.index.hold_alone():  # two that are issued at the same moment have two numbers
        folder, certificate = build_certificate(context, body, address_here(request))
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
    with context.records.index.hold_alone():
        found = find_certificate(context, number)
        if read_certificate_withdrawal(context.records.path(found.certificate.serial), number):
            raise RecordConflictError(f"the certificate {number} was withdrawn already: {found.fault}")
        withdraw_certificate(context.records.path(number_parts(number)[0]), number, body.withdrawal)
    return find_certificate(context, number)


@CERTIFICATES.get("/certificates/{number}", include_in_schema=False, response_class=HTMLResponse)
def show_certificate(number: Number, context: Context) -> HTMLResponse:
    """Show a certificate, and before anything else whether it still holds."""
    found = find_certificate(context, number)
    return render("certificate", found=found, c=found.certificate, simulated=found.certificate.simulated)


def address_here(request: Request) -> str:
    """Return the address under which the service was asked: the code on the sheet leads there."""
    return f"http{'s' if is_secure(request) else ''}://{request.url.netloc}{ROOT.get()}"


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
