"""Compliance design."""
