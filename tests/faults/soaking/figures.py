"""The figures of a soak, and whether they grow."""

import dataclasses
import statistics
from collections.abc import Sequence

# How much a figure may grow: MiB, or a number.
FLAT = {"memory": 10.0, "family": 20.0, "descriptors": 2, "threads": 2, "processes": 0}
WARM = 0.25  # of the samples are left out: caches fill, results are kept for a while


@dataclasses.dataclass(frozen=True)
class Sample:
    """Figures at the end of a round, when nothing runs."""

    minute: float
    goals: int  # verified recordings
    faults: int
    recoveries: int  # times that a person had to do something
    memory: float  # of the server [MiB]
    family: float  # of the processes that it started [MiB]
    descriptors: int
    threads: int
    processes: int
    frames: int  # that a board read
    unreceived: int  # recorded frames that a spoiled port lost
    problems: int


def growth(samples: Sequence[Sample]) -> list[str]:
    """The figures that grow: the last third is compared with the first, when all is warm."""
    warm = samples[int(WARM * len(samples)) :]
    if (third := len(warm) // 3) < 2:
        return []
    found = []
    for name, most in FLAT.items():
        first = statistics.median(getattr(each, name) for each in warm[:third])
        last = statistics.median(getattr(each, name) for each in warm[-third:])
        if last - first > most:
            found.append(f"{name} grows from {first:g} to {last:g}")
    return found


def line(sample: Sample) -> str:
    texts = [f"{value:g}" for value in dataclasses.astuple(sample)]
    return "  ".join(text.rjust(width) for text, width in zip(texts, widths(), strict=True))


def widths() -> list[int]:
    return [len(field.name) for field in dataclasses.fields(Sample)]


def header() -> str:
    return "  ".join(field.name for field in dataclasses.fields(Sample))
