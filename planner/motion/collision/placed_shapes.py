"""Single bodies that stand somewhere, by themselves: their box, and whether two of them touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.kinematics.bodies import Body
from planner.motion.collision.scene import coal_shape, outline
from planner.motion.planning_packages import coal


@dataclass(frozen=True)
class PlacedShape:
    """The coal geometry of a body, and where it stands in the base frame."""

    shape: coal.CollisionGeometry
    at: coal.Transform3s


def place_shape(body: Body) -> PlacedShape:
    """Return the shape of a body whose pose is that in the base frame."""
    return shape_at(coal_shape(body), body.T)


def shape_at(shape: coal.CollisionGeometry, T: Array) -> PlacedShape:
    """Return a shape at a pose (4, 4) [m] in the base frame."""
    return PlacedShape(shape, coal.Transform3s(np.array(T[:3, :3]), np.array(T[:3, 3])))


def is_touching(a: PlacedShape, b: PlacedShape) -> bool:
    """Tell whether two bodies touch."""
    return bool(coal.collide(a.shape, a.at, b.shape, b.at, coal.CollisionRequest(), coal.CollisionResult()))


def shape_distance(a: PlacedShape, b: PlacedShape) -> float:
    """Return how far two bodies are apart [m]; not above zero where they overlap."""
    return float(coal.distance(a.shape, a.at, b.shape, b.at, coal.DistanceRequest(), coal.DistanceResult()))


def box_about(body: Body) -> tuple[Array, Array]:
    """Return the least and the greatest corner (3,) [m] of a body along the axes of its own frame."""
    points, round_by = outline(body), body.size[0] if body.kind in ("capsule", "sphere") else 0.0
    return points.min(axis=0) - round_by, points.max(axis=0) + round_by
