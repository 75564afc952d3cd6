"""The order of the poses, with a proof of how far it is from the shortest."""

__all__ = ["solve"]
