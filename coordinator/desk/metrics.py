"""Numbers for Prometheus: the fleet, its orders, waits, latencies and faults.

Decides: the names of the metrics.  Must not know: HTTP.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from coordinator.desk.line import Line

CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"
_LAST: Final = 100
"""Times from order to course are those of so many orders that began last."""


class Metrics(Collector):
    """The metrics of one desk; `answers`: how many HTTP answers had which status."""

    def __init__(self, line: Line, answers: Mapping[int, int]) -> None:
        self._line = line
        self._answers = answers
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)

    def text(self) -> bytes:
        """Return all metrics in the text format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterable[Metric]:
        """Yield the metrics as they are now."""
        fleet, known = self._line.fleet(), self._line.known
        yield _gauge("up", "Whether the coordinator is heard", float(fleet.is_heard))
        if fleet.age is not None:
            yield _gauge("command_age_seconds", "Age of the last Command", fleet.age)
        yield _gauge("epoch", "The epoch of the last Command", float(fleet.epoch))
        heard = [one for one in fleet.robots if one.is_heard]
        yield _gauge("robots", "Robots that are known", float(len(fleet.robots)))
        yield _gauge("robots_heard", "Robots that are heard", float(len(heard)))
        yield _by(
            "robots_in_phase", "Robots by phase", "phase", Counter(one.phase for one in heard)
        )
        held = sum(1 for one in heard if one.held_by)
        yield _gauge("robots_held", "Robots that another one holds", float(held))
        late = max((one.late for one in heard), default=0.0)
        yield _gauge("lateness_seconds_max", "Lateness of the latest robot", late)
        yield _by("orders", "Orders by state", "state", fleet.orders)
        orders = known.summaries()
        begun = [
            one.accepted - one.released
            for one in orders
            if one.accepted is not None and one.released is not None
        ][-_LAST:]
        if begun:
            text = "Median time from order to course, of the last orders that began"
            yield _gauge("order_begin_seconds_median", text, statistics.median(begun))
        extra = [one.late for one in orders if one.late is not None][-_LAST:]
        if extra:
            text = "Median time by which the last orders were done later than planned"
            yield _gauge("order_late_seconds_median", text, statistics.median(extra))
        yield _gauge("blocks", "Places that are closed", float(len(fleet.blocks)))
        yield _gauge("alarms", "Alarms that stand", float(len(fleet.alarms)))
        yield _count("faults", "Faults that robots reported", "fault", known.faults)
        yield _count("messages", "Messages heard, by kind", "kind", known.heard)
        yield _count("dropped_messages", "Messages not looked at", "cause", self._line.dropped)
        statuses = {str(status): count for status, count in self._answers.items()}
        yield _count("http_answers", "HTTP answers by status", "status", statuses)


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(f"splinefleet_{name}", text, value=value)


def _by(name: str, text: str, label: str, values: Mapping[str, int]) -> Metric:
    family = GaugeMetricFamily(f"splinefleet_{name}", text, labels=[label])
    for key, value in sorted(values.items()):
        family.add_metric([key], float(value))
    return family


def _count(name: str, text: str, label: str, values: Mapping[str, int]) -> Metric:
    family = CounterMetricFamily(f"splinefleet_{name}", text, labels=[label])
    for key, value in sorted(values.items()):
        family.add_metric([key], float(value))
    return family
