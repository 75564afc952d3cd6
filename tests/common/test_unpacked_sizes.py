"""What is small on the disk and large once it is unpacked is refused before it is."""

import struct
import subprocess
import sys
import zlib
from importlib.util import find_spec

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.mat_files import mat_lines


@pytest.mark.slow
def test_a_mat_file_whose_arrays_grow_when_unpacked(tmp_path):
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(260)) + packer.flush()
    path = tmp_path / "log.mat"
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    assert path.stat().st_size < 2_000_000
    with pytest.raises(InputError, match="more than 250000000 bytes once unpacked"):
        mat_lines(path)


def test_a_packed_mat_file_is_read(tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(tmp_path / "log.mat", {"x": np.arange(5.0), "y": np.arange(5.0)}, do_compression=True)
    assert mat_lines(tmp_path / "log.mat")[0] == "x,y"


@pytest.mark.slow
def test_an_image_whose_head_says_more_pixels_than_a_camera_has(tmp_path):
    if find_spec("cv2") is None:
        pytest.skip("OpenCV is not installed")
    head = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path = tmp_path / "pose_1.png"
    rows = zlib.compress(bytes(30_001 * 30), 1)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b""))
    code = f"""
from pathlib import Path
from planner.gauges.vision.board import Board, BoardFile
from planner.gauges.vision.images import CornerSeeker
file = BoardFile(kind="charuco", dictionary="DICT_4X4_50", columns=5, rows=4, square_mm=30, marker_mm=22)
CornerSeeker.of(Board(file)).read(Path({str(path)!r}))
"""  # a process of its own: OpenCV takes the bound when it is loaded
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "InputError" in done.stderr
    assert "more than 200000000 pixels" in done.stderr
