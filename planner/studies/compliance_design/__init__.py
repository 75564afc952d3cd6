"""Places of loaded circles that tell the compliances apart."""

__all__ = ["circle_candidates", "common_fit", "pictures", "place_selection", "results"]
