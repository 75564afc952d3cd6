"""What a further session would bring: live estimate, advice, remaining errors."""

__all__ = ["live_advice", "planned_poses", "remaining_errors"]
