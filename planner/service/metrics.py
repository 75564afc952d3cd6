"""``/metrics``: what a plant's monitoring reads (Prometheus' text format 0.0.4): queue, durations, failures, robots."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Response

from planner import __version__
from planner.service.context import Context, ServiceContext

METRICS = APIRouter(include_in_schema=False)
MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
Labels = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Metric:
    """A quantity with its values.

    Attributes:
        name, kind, words: as Prometheus names and types it, and what it is.
        samples: values with their labels.
    """

    name: str
    kind: str
    words: str
    samples: Sequence[tuple[Labels, float]]

    def lines(self) -> Iterator[str]:
        """Yield the lines of the metric in the text format of Prometheus."""
        yield f"# HELP {self.name} {self.words}"
        yield f"# TYPE {self.name} {self.kind}"
        for labels, value in self.samples:
            inner = ",".join(f'{key}="{_escape(text)}"' for key, text in labels)
            yield f"{self.name}{{{inner}}} {value!r}" if inner else f"{self.name} {value!r}"


def _escape(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


@METRICS.get("/metrics")
def get_metrics(context: Context) -> Response:
    """Get the metrics."""
    text = "".join(f"{line}\n" for metric in collect_metrics(context) for line in metric.lines())
    return Response(text, media_type=MEDIA_TYPE)


def collect_metrics(context: ServiceContext) -> list[Metric]:
    """Return all metrics as they are now."""
    jobs, spent = context.jobs.statistics(), context.jobs.durations()
    count = [((("kind", kind), ("state", state)), float(n)) for kind, state, n in jobs]
    seconds = [((("kind", kind),), total) for kind, _, total in spent]
    ended = [((("kind", kind),), float(n)) for kind, n, _ in spent]
    states = context.records.index.count_states(context.judge.unrecorded_changes())
    robots = [((("state", state),), float(n)) for state, n in states.items()]
    return [
        Metric("edbb_info", "gauge", "Version of the planner.", [((("version", __version__),), 1.0)]),
        Metric("edbb_jobs", "gauge", "Jobs that are kept, by kind and state.", count),
        Metric(
            "edbb_oldest_waiting_seconds", "gauge", "Age of the oldest waiting job.", [((), context.jobs.waiting_s())]
        ),
        Metric("edbb_job_run_seconds", "gauge", "Time that kept jobs have run until they were done.", seconds),
        Metric("edbb_job_runs", "gauge", "Kept jobs that were done.", ended),
        Metric("edbb_files_bytes", "gauge", "Size of all files.", [((), float(context.keeper.size_bytes()))]),
        Metric("edbb_robots", "gauge", "Robots with a record, by state.", robots),
    ]
