"""What every measurement prints and writes."""

import argparse
import json
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One figure: the median of its samples, with their spread.

    Attributes:
        name: Name of the figure.
        unit: Unit of the samples.
        samples: What was measured.
        limit: Largest median that is accepted; None for no limit.
    """

    name: str
    unit: str
    samples: Sequence[float]
    limit: float | None = None

    @property
    def value(self) -> float:
        return statistics.median(self.samples)

    @property
    def verdict(self) -> str:
        """Whether the median is within the limit; empty for no limit."""
        if self.limit is None:
            return ""
        return f"{self.limit:g} {'met' if self.value <= self.limit else 'not met'}"


def arguments(description: str) -> argparse.ArgumentParser:
    """The options that every measurement has."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there")
    parser.add_argument("--runs", type=int, default=7, help="samples per figure")
    return parser


def show(rows: Sequence[Row], file: Path | None) -> None:
    """Print a table, and write the rows to a file if one is named."""
    line = "{:<30} {:>10} {:>10} {:>10}  {:<6} {:<8} {}\n"
    limit = "limit" if any(row.limit is not None for row in rows) else ""
    heading = line.format("name", "median", "min", "max", "unit", "samples", limit)
    sys.stdout.write(heading.rstrip() + "\n")
    for row in rows:
        figures = (f"{x:.4g}" for x in (row.value, min(row.samples), max(row.samples)))
        words = line.format(row.name, *figures, row.unit, len(row.samples), row.verdict)
        sys.stdout.write(words.rstrip() + "\n")
    if file:
        plain = [{"name": row.name, "value": row.value, "unit": row.unit} for row in rows]
        file.write_text(json.dumps(plain, indent=2) + "\n")
