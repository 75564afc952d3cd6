"""What a camera needs beside its gauge: the lens, the board, where a board stands in one image, corners in images."""

__all__ = ["images"]
