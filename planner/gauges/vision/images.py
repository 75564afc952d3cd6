"""Corners of a board in images, by OpenCV; of each image that does not show them one sentence says why."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PositiveInt

from planner.common.errors import InputError, MissingProgramError, did_you_mean
from planner.common.files import read_bytes
from planner.common.schema import read_toml_content, validate
from planner.common.units import Array
from planner.gauges.vision.board import Board, BoardFile

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")
_PIXELS = "OPENCV_IO_MAX_IMAGE_PIXELS"
LEAST_SHARE, LEAST_CORNERS = 0.15, 6  # of a board that must be seen, of one with so many corners


class BoardOfImages(BoardFile):
    """``board.toml`` (schema ``edbb-board/1``): the board, and the image size for which its lens was calibrated."""

    schema_: Literal["edbb-board/1"] = Field(alias="schema")
    width_px: PositiveInt | None = None
    height_px: PositiveInt | None = None


@dataclass(frozen=True)
class BoardInImages:
    """A board that is sought in images.

    Attributes:
        board: which one.
        size: width and height that images must have [px]; with ``None`` all have those of the first.
    """

    board: Board
    size: tuple[int, int] | None

    CELL: ClassVar[str] = "gauge"

    @classmethod
    def read(cls, path: Path) -> BoardInImages:
        """Read ``board.toml``, or a cell file with a camera.

        Raises:
            InputError: it is neither, or a key is wrong.
        """
        content = read_toml_content(path)
        gauge = content.get(cls.CELL)
        if isinstance(gauge, dict) and isinstance(gauge.get("board"), dict):
            lens = gauge.get("lens", {})
            board = validate(gauge["board"], BoardFile, f"{path}: [gauge.board]").board
            size = (int(lens["width_px"]), int(lens["height_px"])) if {"width_px", "height_px"} <= set(lens) else None
            return cls(board, size)
        file = validate(content, BoardOfImages, str(path))
        both = (file.width_px, file.height_px)
        size = None if both[0] is None or both[1] is None else (both[0], both[1])
        return cls(file.board, size)


@dataclass(frozen=True)
class FoundCorners:
    """Corners in images: number of each image's pose (n,), pixels (n, K, 2), NaN where one is not seen; and what is not
    used, a sentence each with the file."""

    poses: tuple[int, ...]
    pixels: Array
    left_out: tuple[str, ...]


def find_corners(folder: Path, sought: BoardInImages) -> FoundCorners:
    """Return the corners of the board in the images of a folder, whose names end in the numbers of their poses.

    Raises:
        InputError: no folder, no image in it, two of one pose, or none that shows the board.
        MissingProgramError: OpenCV is not installed.
    """
    files = _images_by_pose(folder)
    seeker = CornerSeeker.of(sought.board)
    poses, pixels, left_out = list[int](), list[Array](), list[str]()
    size = sought.size
    for pose, path in files:
        image = seeker.read(path)
        if image is None:
            left_out.append(f"{path}: is no image that can be read")
            continue
        height, width = image.shape
        size = size or (width, height)
        if (width, height) != size:
            left_out.append(
                f"{path}: has {width} × {height} px, but the lens was calibrated at {size[0]} × {size[1]} px"
                if sought.size
                else f"{path}: has {width} × {height} px, the images before it {size[0]} × {size[1]} px"
            )
            continue
        found = seeker.corners(image)
        if isinstance(found, str):
            left_out.append(f"{path}: {found}")
            continue
        poses.append(pose)
        pixels.append(found)
    if not poses:
        raise InputError(f"{folder}: no image of {len(files)} can be used; the first: {left_out[0]}")
    return FoundCorners(tuple(poses), np.stack(pixels), tuple(left_out))


def _images_by_pose(folder: Path) -> list[tuple[int, Path]]:
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of images")
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in ENDINGS)
    if not files:
        raise InputError(f"{folder}: there is no image ({', '.join(ENDINGS)})")
    by_pose: dict[int, Path] = {}
    for path in files:
        number = re.search(r"(\d+)\D*$", path.stem)
        if number is None:
            raise InputError(f"{path}: the name does not end in the number of a pose, such as pose_012{path.suffix}")
        pose = int(number[1])
        if pose in by_pose:
            raise InputError(f"{path}: is of pose {pose}, as {by_pose[pose].name} is; one image a pose")
        by_pose[pose] = path
    return sorted(by_pose.items())


@dataclass(frozen=True)
class CornerSeeker:
    """OpenCV's detectors for one board; images are arrays of grey (height, width)."""

    cv2: Any
    board: Board
    markers: Any
    charuco: Any

    @classmethod
    def of(cls, board: Board) -> CornerSeeker:
        """Return the seeker with detectors for the board.

        Raises:
            InputError: the dictionary is none of OpenCV's, or has too few markers.
            MissingProgramError: OpenCV is not installed.
        """
        # 200_000_000: pixels, of the largest cameras; OpenCV reads it when it is loaded
        os.environ.setdefault(_PIXELS, "200000000")
        try:
            import cv2
        except ImportError as err:
            raise MissingProgramError(
                "corners are found by OpenCV: pip install 'edbb-planner[camera]' installs it"
            ) from err
        file, known = board.file, sorted(n for n in dir(cv2.aruco) if n.startswith("DICT_"))
        if file.dictionary not in known:
            hint = did_you_mean(file.dictionary, known)
            raise InputError(f"the board's dictionary '{file.dictionary}' is none of OpenCV's{hint}")
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, file.dictionary))
        numbers = board.markers
        if numbers[-1] >= len(dictionary.bytesList):
            raise InputError(
                f"the board has markers {numbers[0]} to {numbers[-1]}, but {file.dictionary} has only "
                f"{len(dictionary.bytesList)}"
            )
        how = cv2.aruco.DetectorParameters()
        charuco = None
        if file.kind == "charuco":
            theirs = cv2.aruco.CharucoBoard(
                (file.columns, file.rows), float(file.square_mm or 0), float(file.marker_mm), dictionary, numbers
            )
            theirs.setLegacyPattern(file.legacy)
            charuco = cv2.aruco.CharucoDetector(theirs, cv2.aruco.CharucoParameters(), how)
        else:
            how.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        return cls(cv2, board, cv2.aruco.ArucoDetector(dictionary, how), charuco)

    def read(self, path: Path) -> np.ndarray | None:
        """Return an image in grey; ``None`` where it is none.

        Raises:
            InputError: its head says more pixels than a camera has.
        """
        data = np.frombuffer(read_bytes(path), dtype=np.uint8)
        try:
            image = self.cv2.imdecode(data, self.cv2.IMREAD_GRAYSCALE) if len(data) else None
        except self.cv2.error as err:
            raise InputError(
                f"{path}: OpenCV does not read the image: it has more than {os.environ.get(_PIXELS)} pixels, or is "
                "damaged; give the image as the camera has written it"
            ) from err
        return None if image is None else np.asarray(image)

    def corners(self, image: np.ndarray) -> Array | str:
        """Return the corners (K, 2) [px], NaN where one is not seen; or why the image cannot be used."""
        misplaced = 6.0  # [px] rms that corners miss a flat board's by; a lens bends them by less within one image
        found = self._charuco(image) if self.charuco is not None else self._tags(image)
        count = int((~np.isnan(found[:, 0])).sum())
        least = min(LEAST_CORNERS, len(self.board)) if self.charuco is None else LEAST_CORNERS
        if count < max(least, LEAST_SHARE * len(self.board)):
            return self._why_so_few(image, found[~np.isnan(found[:, 0])])
        if (off := self._distance_from_flat(found)) > misplaced:
            return f"its corners miss those of the {self.board} by {off:.0f} px (rms): another board, or it is bent"
        return blur_text(image, found[~np.isnan(found[:, 0])]) or found

    def _charuco(self, image: np.ndarray) -> Array:
        out = np.full((len(self.board), 2), np.nan)
        corners, numbers, _, _ = self.charuco.detectBoard(image)
        if numbers is not None and len(numbers):
            out[np.ravel(numbers)] = np.reshape(corners, (-1, 2))
        return out

    def _tags(self, image: np.ndarray) -> Array:
        out = np.full((len(self.board) // 4, 4, 2), np.nan)
        corners, numbers, _ = self.markers.detectMarkers(image)
        first, count = self.board.file.first, len(out)
        for quad, number in zip(corners, [] if numbers is None else np.ravel(numbers), strict=False):
            if 0 <= number - first < count:
                out[number - first] = np.reshape(quad, (4, 2))
        return out.reshape(-1, 2)

    def _why_so_few(self, image: np.ndarray, corners: Array) -> str:
        quads, numbers, _ = self.markers.detectMarkers(image)
        if blurred := blur_text(image, np.reshape(quads, (-1, 2)) if len(quads) else corners):
            return blurred
        count = len(corners)
        seen = [] if numbers is None else sorted({int(n) for n in np.ravel(numbers)})
        own = set(self.board.markers.tolist())
        if count:
            return f"only {count} of {len(self.board)} corners of the board are seen"
        if seen and not own & set(seen):
            return f"shows markers {_listing(seen)}, and none of the board's ({min(own)} to {max(own)}): another board"
        if foreign := sorted(set(seen) - own):
            return f"shows markers {_listing(foreign)} that the board ({min(own)} to {max(own)}) has not: another board"
        if seen and self._is_other_pattern(image):
            key = str(not self.board.file.legacy).lower()
            return f"shows the pattern of another version of OpenCV: write legacy = {key} for the board"
        if seen:
            return f"shows {len(seen)} markers of the board and no corner between two of them"
        aruco = self.cv2.aruco
        names = (n for n in dir(aruco) if n.startswith("DICT_") and n != self.board.file.dictionary)
        for name in sorted(names, key=_marker_count):  # a smaller dictionary is a part of the larger one
            other = aruco.ArucoDetector(aruco.getPredefinedDictionary(getattr(aruco, name)), aruco.DetectorParameters())
            if len(other.detectMarkers(image)[0]) >= min(4, len(own)):
                return f"shows markers of {name}, not of {self.board.file.dictionary}: another board"
        return "no board is seen: is it in the picture, in focus and lit?"

    def _is_other_pattern(self, image: np.ndarray) -> bool:
        """Tell whether the board is seen once its squares are taken as OpenCV drew them before 4.6, or since."""
        file = self.board.file
        if file.kind != "charuco":
            return False
        other = CornerSeeker.of(file.model_copy(update={"legacy": not file.legacy}).board)
        return bool((~np.isnan(other._charuco(image)[:, 0])).sum() >= LEAST_CORNERS)

    def _distance_from_flat(self, found: Array) -> float:
        """Return by how much the corners miss the picture of a flat board, rms [px]."""
        seen = ~np.isnan(found[:, 0])
        if seen.sum() <= 4:
            return 0.0
        flat = np.ascontiguousarray(self.board.corners[seen, :2])
        H, _ = self.cv2.findHomography(flat, found[seen], 0)
        if H is None:
            return float("inf")
        p = np.column_stack([flat, np.ones(len(flat))]) @ H.T
        return float(np.sqrt(((p[:, :2] / p[:, 2:] - found[seen]) ** 2).sum(axis=1).mean()))


def edge_width(image: np.ndarray, corners: Array) -> float:
    """Return how wide edges at corners (k, 2) [px] are: what lies between light and dark over the steepest slope [px].

    The median over the corners; infinite where there is no edge at most of them.
    """
    plain_image = 8  # levels of grey between light and dark below which there is no edge
    half_patch = 8  # [px] about a corner, in which its edges are looked at
    widths = []
    for u, v in np.round(corners).astype(int):
        patch = image[max(v - half_patch, 0) : v + half_patch + 1, max(u - half_patch, 0) : u + half_patch + 1]
        patch = patch.astype(float)
        if min(patch.shape) < half_patch:
            continue
        dark, light = np.percentile(patch, [10, 90])
        slope = np.hypot(*(g[1:-1, 1:-1] for g in np.gradient(patch)))
        widths.append((light - dark) / np.percentile(slope, 97) if light - dark > plain_image else np.inf)
    return float(np.median(widths)) if widths else float("inf")


def blur_text(image: np.ndarray, corners: Array) -> str:
    """Say that edges at corners (k, 2) [px] are too wide, where they are; nothing where there is no corner."""
    blurred = 4.5  # [px] mean width of the edges at the corners: focused and at rest it is 1.5 to 3
    width = edge_width(image, corners) if len(corners) else 0.0
    return (
        f"is blurred: edges at the corners are {width:.1f} px wide, {blurred:g} px at most are usable"
        if width > blurred
        else ""
    )


def _marker_count(dictionary: str) -> tuple[int, str]:
    """Return how many markers a dictionary of OpenCV has by its name, those that do not say it last, and the name."""
    count = dictionary.rsplit("_", 1)[-1]
    return int(count) if count.isdigit() else sys.maxsize, dictionary


def _listing(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:4])) + (" …" if len(numbers) > 4 else "")
