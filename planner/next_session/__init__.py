"""What a further session would bring: live estimate, advice, remaining errors."""

__all__ = ["live_advice", "more_poses", "planned_poses", "remaining_errors", "where_it_counts"]
