"""Readers of target files, one file a language: they note targets and the places of their numbers."""
