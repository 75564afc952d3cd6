"""The plan of a measuring session: visits, way, verdict, timing, program, and the document of it."""

__all__ = [
    "as_published", "document", "evaluations", "judgement", "mount", "movable_cell", "neutral_program",
    "options", "plan_record", "plan_types", "plan_verdict", "planned_session", "planning", "point_poses", "release",
    "tour_cost", "tour_drive",
]  # fmt: skip
