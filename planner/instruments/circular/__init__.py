"""Circular."""
