"""Paths between poses that are proven free along their whole length."""

__all__ = ["connection", "constraints", "parts", "roadmap", "verdict"]
