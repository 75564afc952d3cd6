"""Screenshots held against kept ones, panel by panel, so that neither fonts nor other machines matter.

Of each panel (section, figure, 3D view, sheet) of a page ``pictures.json`` keeps its name, where it stands across the
page, how tall it is for its width, and a picture of 12 × 8 colours. A panel that is missing, stands elsewhere, is
another shape, or looks different fails. ``EDBB_PICTURES=FOLDER`` keeps new ones, and puts whole
screenshots into that folder to be looked at.
"""

import json
import os
import re
import zlib
from base64 import b64decode, b64encode
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

KEPT = Path(__file__).with_name("pictures.json")
WIDE, HIGH = 12, 8  # cells of a panel's picture
SHIFT = 0.04  # of the page's width that a panel may stand elsewhere
TALLER = 1.6  # times that a panel may be taller or lower: other fonts wrap elsewhere
FAR = 6.0  # of 255, rms over the cells, each at its best place within one cell: other fonts make 3
FAR_3D = 3.0  # the same of a 3D view, which has no letters, each cell at its place
SETTLED_MS = 500  # a view drawn by a processor is late
VIEW = "view"  # id of a 3D view
CHOSEN = ", ".join(f"main {c}" for c in ("h1", "section", "figure", ".stage", ".sheet", "ol", "table"))
PANELS = """(chosen) => [...document.querySelectorAll("header, " + chosen)]
  .filter((e) => e.checkVisibility() && e.getBoundingClientRect().height > 4)
  .map((e) => { const r = e.getBoundingClientRect(), title = e.querySelector("figcaption, caption, h1");
    return { name: e.getAttribute("aria-labelledby") || e.id || title?.textContent || e.className || e.tagName,
      box: [r.left + scrollX, r.top + scrollY, r.right + scrollX, r.bottom + scrollY] }; })"""
LOADED = """async () => { for (const i of document.images) { i.loading = "eager"; await i.decode().catch(() => {}); }
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }"""


def take(page):
    """Return the panels of a page as they are: (name, left, right, shape, colours (8, 12, 3))."""
    page.evaluate(LOADED)
    page.wait_for_timeout(SETTLED_MS)
    picture = Image.open(BytesIO(page.screenshot(full_page=True))).convert("RGB")
    wide, seen = page.viewport_size["width"], []
    for panel in page.evaluate(PANELS, CHOSEN):
        left, top, right, bottom = panel["box"]
        small = picture.crop([round(v) for v in panel["box"]]).resize((WIDE, HIGH), Image.Resampling.BOX)
        name = re.sub(r"\W+", " ", panel["name"]).strip()[:40]
        seen.append((name, left / wide, right / wide, (bottom - top) / (right - left), np.asarray(small)))
    return seen


def distance(one, other, shift=1):
    """Root mean square difference of two small pictures, each cell at its best place within ``shift`` cells."""
    one, other = one.astype(float), other.astype(float)
    padded = np.pad(other, ((shift, shift), (shift, shift), (0, 0)), mode="edge")
    steps = range(2 * shift + 1)
    around = [padded[i : i + HIGH, k : k + WIDE] for i in steps for k in steps]
    return float(np.sqrt(np.min([((one - a) ** 2).mean(axis=2) for a in around], axis=0).mean()))


def differences(page, name):
    """Say in which panels a page differs from what is kept under a name."""
    kept, seen = json.loads(KEPT.read_text())[name], take(page)
    names = [p[0] for p in kept], [p[0] for p in seen]
    if names[0] != names[1]:
        return [f"panels: {names[1]}, kept: {names[0]}"]
    found = []
    for (panel, left, right, shape, colours), now in zip(kept, seen, strict=True):
        then = np.frombuffer(zlib.decompress(b64decode(colours)), np.uint8).reshape(HIGH, WIDE, 3)
        if max(abs(left - now[1]), abs(right - now[2])) > SHIFT:
            found.append(f"{panel}: from {now[1]:.2f} to {now[2]:.2f} of the width, kept {left} to {right}")
        if not 1 / TALLER < now[3] / shape < TALLER:
            found.append(f"{panel}: {now[3]:.2f} times as tall as wide, kept {shape}")
        is_view = panel == VIEW
        if (off := distance(now[4], then, 0 if is_view else 1)) > (FAR_3D if is_view else FAR):
            found.append(f"{panel}: looks different by {off:.0f} of 255")
    return found


def compare(page, name):
    """Hold a page against what is kept under a name."""
    folder = os.environ.get("EDBB_PICTURES")
    if not folder:
        assert not (found := differences(page, name)), (name, found)
        return
    page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)
    whole = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    whole[name] = [
        (n, round(a, 3), round(b, 3), round(s, 3), b64encode(zlib.compress(c.tobytes(), 9)).decode())
        for n, a, b, s, c in take(page)
    ]
    pages = (f'"{n}": [\n' + ",\n".join(json.dumps(p) for p in v) + "\n]" for n, v in whole.items())
    KEPT.write_text("{\n" + ",\n".join(pages) + "\n}\n")


def check_sensitivity(page, name):
    """See that it fails without a panel, and without the robot in the 3D view, and passes in other fonts."""
    hide = "(on) => document.querySelectorAll('main section')[1].style.display = on ? 'none' : ''"
    page.evaluate(hide, True)
    assert [d for d in differences(page, name) if d.startswith("panels")]
    page.evaluate(hide, False)
    page.uncheck(".layers input >> nth=0")
    assert [d for d in differences(page, name) if d.startswith(VIEW)]
    page.check(".layers input >> nth=0")
    page.evaluate("document.body.style.font = '17px/1.5 serif'")
    assert not differences(page, name)
    page.evaluate("document.body.style.font = ''")
