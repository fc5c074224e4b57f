"""The figures of a soak, and whether they grow."""

import dataclasses
import statistics
from collections.abc import Sequence

# How much a figure may grow: MiB, or a number. Pools start their last threads late.
FLAT = {
    "memory": 10.0,
    "family": 20.0,
    "descriptors": 2,
    "threads": 3,
    "processes": 0,
}
WARM = 0.25  # of the samples are left out: caches fill, results are kept for a while
FEWEST = 6  # warm samples that show growth


@dataclasses.dataclass(frozen=True)
class Sample:
    """Figures at the end of a round, when nothing runs."""

    minute: float
    goals: int  # verified recordings
    faults: int
    recoveries: int  # times that a person had to do something, and it worked
    memory: float  # of the server [MiB]
    family: float  # of the processes that it started [MiB]
    descriptors: int
    threads: int
    processes: int
    frames: int  # that a board read
    unreceived: int  # recorded frames that a spoiled port lost
    problems: int


def ends(samples: Sequence[Sample], name: str) -> tuple[float, float, float]:
    """A figure in the first and in the last quarter (medians), and in the last sample."""
    values = [getattr(each, name) for each in samples]
    quarter = max(1, len(values) // 4)
    return statistics.median(values[:quarter]), statistics.median(values[-quarter:]), values[-1]


def growth(samples: Sequence[Sample]) -> list[str]:
    """The figures that grow when all is warm: from the first quarter to the last, or to the end."""
    warm = samples[int(WARM * len(samples)) :]
    if len(warm) < FEWEST:
        return []
    found = []
    for name, most in FLAT.items():
        first, *later = ends(warm, name)
        if max(later) - first > most:
            found.append(f"{name} grows from {first:g} to {max(later):g}")
    return found


def line(sample: Sample) -> str:
    texts = [f"{value:g}" for value in dataclasses.astuple(sample)]
    return "  ".join(text.rjust(width) for text, width in zip(texts, widths(), strict=True))


def widths() -> list[int]:
    return [len(field.name) for field in dataclasses.fields(Sample)]


def header() -> str:
    return "  ".join(field.name for field in dataclasses.fields(Sample))
