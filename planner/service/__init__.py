"""The service: jobs that survive a crash, HTTP interface, pages; it runs the command line in processes of its own."""

__all__: list[str] = []
