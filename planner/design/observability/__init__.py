"""What poses show: information, observability indices, identifiable parameters, and sentences about the rest."""

__all__ = ["identifiability", "information"]
