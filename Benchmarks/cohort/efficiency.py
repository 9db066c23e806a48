"""What more workers are worth, on paper.

A cohort of N cases on w workers takes

    T = s + max(⌈N / w⌉ · t, N · d)

seconds: s until all workers compute, t for a case on one of them, and d for what the leader does for a case, one after
the other (handing it out, taking its outcome in, writing the table). The efficiency is N · t / (w · T), the share of the time
in which workers compute. It is assumed that a shared disk gives all workers their volumes as fast as it gives one, and that
workers have a core each, as when t was measured with all cores of one computer at work.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Scaling:
    """Seconds to start, for a case on a worker, and of the leader for a case."""

    start_s: float
    case_s: float
    leader_s: float

    def seconds(self, cases: int, workers: int) -> float:
        """For a whole cohort."""
        return self.start_s + max(math.ceil(cases / workers) * self.case_s, cases * self.leader_s)

    def efficiency(self, cases: int, workers: int) -> float:
        """Share of the time in which workers compute, 0 to 1."""
        return cases * self.case_s / (workers * self.seconds(cases, workers))

    def cases_per_hour(self, cases: int, workers: int) -> float:
        """Of a whole cohort, its start included."""
        return 3600.0 * cases / self.seconds(cases, workers)

    @property
    def most_workers(self) -> float:
        """Beyond so many, the leader is the bottleneck."""
        return self.case_s / self.leader_s


def start_seconds(total_s: float, case_s: float, cases: int, workers: int) -> float:
    """What a measured cohort took beyond its cases: until all compute, and while the last one computes alone."""
    return max(0.0, total_s - math.ceil(cases / workers) * case_s)
