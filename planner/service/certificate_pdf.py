"""A certificate as PDF: one A4 sheet, whatever it says, with the address where it is said whether it still holds."""

from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from planner.service.certificate import COVERAGE, Certificate, CertificateFile

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
    across = "SIMULATED" if c.simulated else ""
    for turn, text in ((50, across), (-50, "WITHDRAWN" if fault else "")):
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

    if not text:
        return
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
    from reportlab.platypus import Paragraph

    style = ParagraphStyle(
        "text", fontName=BOLD if bold else FONT, fontSize=size, leading=1.28 * size, textColor=colour,
        alignment=TA_RIGHT if right else TA_LEFT, splitLongWords=1, wordWrap=None,
    )  # fmt: skip
    return Paragraph(escape(text), style)


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
