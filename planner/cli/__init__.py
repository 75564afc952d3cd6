"""The command ``edbb``."""

__all__: list[str] = []
