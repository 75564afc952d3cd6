"""Discrimination."""
