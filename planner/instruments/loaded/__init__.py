"""Loaded."""
