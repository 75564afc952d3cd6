"""The cell: robot, tool, fixtures, gauge, obstacles and cable, read from one TOML file."""

from planner.cell.circles import Circle
from planner.cell.file import FIRST_POINT, Aim
from planner.cell.model import Cell
from planner.cell.parts import Ball, Base, Cable, Controller, Fixture, Gauge, Motion, PlanOptions, Tool, ToolPoint
from planner.cell.reading import cell_of, load_cell, shipped_cells

__all__ = [
    "FIRST_POINT",
    "Aim",
    "Ball",
    "Base",
    "Cable",
    "Cell",
    "Circle",
    "Controller",
    "Fixture",
    "Gauge",
    "Motion",
    "PlanOptions",
    "Tool",
    "ToolPoint",
    "cell_of",
    "load_cell",
    "shipped_cells",
]
