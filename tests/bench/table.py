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
    """One figure: the median of its samples, with their spread, and its limit, if it has one.

    Attributes:
        each: True if each sample must meet the limit `at_most`, and not only the median.
    """

    name: str
    unit: str
    samples: Sequence[float]
    at_most: float | None = None
    at_least: float | None = None
    each: bool = False

    @property
    def value(self) -> float:
        return statistics.median(self.samples)

    @property
    def asked(self) -> dict[str, float | bool]:
        """The limit, and whether the figure meets it; empty without a limit."""
        if self.at_most is not None:
            judged = max(self.samples) if self.each else self.value
            return {"at_most": self.at_most, "met": judged <= self.at_most}
        if self.at_least is not None:
            return {"at_least": self.at_least, "met": self.value >= self.at_least}
        return {}


def arguments(description: str) -> argparse.ArgumentParser:
    """The options that every measurement has."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there")
    parser.add_argument("--runs", type=int, default=7, help="samples per figure")
    return parser


def show(rows: Sequence[Row], file: Path | None) -> None:
    """Print a table, and write the rows to a file if one is named."""
    line = "{:<30} {:>10} {:>10} {:>10}  {:<6} {:<8} {}\n"
    sys.stdout.write(line.format("name", "median", "min", "max", "unit", "samples", "asked"))
    for row in rows:
        figures = (f"{x:.4g}" for x in (row.value, min(row.samples), max(row.samples)))
        asked = " ".join(f"{name} {value}" for name, value in row.asked.items())
        written = line.format(row.name, *figures, row.unit, len(row.samples), asked)
        sys.stdout.write(written.rstrip() + "\n")
    if file:
        plain = [
            {"name": row.name, "value": row.value, "unit": row.unit, **row.asked} for row in rows
        ]
        file.write_text(json.dumps(plain, indent=2) + "\n")
