"""Images in a run: a row a corner in its file, a sample an image in the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.lazy_modules import pl
from planner.common.units import Array, IntArray, read_only
from planner.runs.table import RunTable

PIXEL = ("u", "v")
CORNER = "corner"
MOST_CORNERS = 10_000  # of a board


def split_images(table: RunTable) -> tuple[RunTable, Array | None]:
    """Return the table with one row an image, and the pixels of its corners (n, K, 2) [px], NaN where one is not seen.

    Rows that follow each other with the same pose, session and joint angles are one image. Other tables come back as
    they are, with ``None``.

    Raises:
        InputError: corners without pixels or the other way round, no number of a corner, or one twice in an image.
    """
    pixel = table.group(PIXEL, "there is no column {} beside the others")
    if pixel is None and not table.has(CORNER):
        return table, None
    lacking = "a corner of an image needs the columns corner, u_px and v_px: there is no {}"
    numbers = table.group((CORNER, *PIXEL), lacking)
    assert numbers is not None
    corner = numbers[:, 0].astype(np.int64)
    image = _number_images(table)
    first = np.flatnonzero(np.diff(image, prepend=-1))
    order = np.lexsort((corner, image))
    twice = order[1:][(np.diff(image[order]) == 0) & (np.diff(corner[order]) == 0)]
    if len(twice):
        row = int(twice.min())
        raise table.source.error(
            row, CORNER, f"corner {corner[row]} stands twice in one image; give each image its own number in pose"
        )
    pixels = np.full((len(first), int(corner.max()) + 1, 2), np.nan)
    pixels[image, corner] = numbers[:, 1:]
    rest = table.frame.drop([CORNER, *PIXEL])[first]
    return replace(table, frame=rest, source=table.source.take(first)), read_only(pixels)


def _number_images(table: RunTable) -> IntArray:
    """Number the images in the order of their rows, (n,)."""
    names = [k for k in table.frame.columns if k in ("pose", "session") or k[0] == "q" or k.startswith("cmd")]
    state = np.stack([np.nan_to_num(table.frame[k].to_numpy().astype(float), nan=-1.0) for k in names], axis=1)
    new = np.any(np.diff(state, axis=0, prepend=state[:1]) != 0.0, axis=1)
    return np.asarray(np.cumsum(new), dtype=np.int64)


def corner_rows(pixels: Array) -> tuple[IntArray, IntArray, Array]:
    """Return the image and the corner of each row of a file, and its pixels (m, 2) [px]."""
    image, corner = np.nonzero(~np.isnan(pixels[..., 0]))
    return image, corner, pixels[image, corner]


def frame_of_corners(frame: pl.DataFrame, pixels: Array, decimals: int) -> pl.DataFrame:
    """Return a table with a row an image as one with a row a corner."""
    image, corner, uv = corner_rows(pixels)
    u, v = np.round(uv, decimals).T + 0.0
    return frame[image].with_columns(pl.Series(CORNER, corner), pl.Series("u_px", u), pl.Series("v_px", v))


def pad_corners(parts: Sequence[Array]) -> list[Array]:
    """Return pixels (n, K, 2) or what is seen (n, K) of several runs with as many corners each."""
    most = max(p.shape[1] for p in parts)

    def whole(p: Array) -> Array:
        """Return an array with room for all corners, NaN where an image lacks one."""
        out = np.full((len(p), most, *p.shape[2:]), False if p.dtype == bool else np.nan, dtype=p.dtype)
        out[:, : p.shape[1]] = p
        return out

    return [whole(p) for p in parts]
