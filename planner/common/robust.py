"""Fits that outliers do not pull: Huber's weights."""

HUBER_SIGMAS = 1.5
"""[sigma] from which on a reading counts less: 95 % as sharp as least squares where the noise is normal."""
