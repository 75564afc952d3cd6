"""Plan, certify and write measurement programs that calibrate robots with simple length gauges."""

__version__ = "0.1.0"
