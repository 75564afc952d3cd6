"""The service: jobs that survive a crash, an HTTP interface, and the pages for the person at the cell."""

__all__: list[str] = []
