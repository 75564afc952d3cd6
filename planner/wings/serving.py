"""The service: the planner for browsers and programs, and the command line on a server."""

from planner.common.advice import Occasion, register_advice
from planner.common.commands import register_command, register_remote

PARTS = ("service", "cli/remote.py")

register_command(
    "serve",
    "Serve the planner to browsers and programs.",
    "planner.service.command:serve_command",
    needs=("checks", "circles", "studies", "validation"),
)
register_advice(Occasion.PLANNING_ELSEWHERE, ", or let a server do it: --server URL, where edbb serve runs")
register_advice(Occasion.PROVING_ELSEWHERE, ", or let a server do it (--server URL)")
register_advice(Occasion.CLUSTER_KEYS, "'edbb serve keys DIR' makes a folder of keys")
register_remote("planner.cli.remote:run_on_server")
