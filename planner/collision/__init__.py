"""Collisions of links, tool, bar, floor and obstacles: bulk checks by coal, and a second opinion by fcl."""

from planner.collision.judge import FclJudge
from planner.collision.pieces import Piece
from planner.collision.scene import Scene, build_scene
from planner.collision.world import CollisionWorld

__all__ = ["CollisionWorld", "FclJudge", "Piece", "Scene", "build_scene"]
