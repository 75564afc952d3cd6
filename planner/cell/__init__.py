"""The cell: robot, tool, fixtures, gauge, obstacles and cable, read from one TOML file."""

from planner.cell.circles import Circle
from planner.cell.model import Ball, Base, Cable, Cell, Controller, Fixture, Gauge, Motion, PlanOptions, Tool
from planner.cell.reading import load_cell, shipped_cells

__all__ = [
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
    "load_cell",
    "shipped_cells",
]
