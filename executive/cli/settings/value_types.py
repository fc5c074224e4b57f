"""Types of the values of options and settings."""

import math
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import click

from hardware.spelling import did_you_mean

_LEAST_PERCENT = 5  # smallest number above 1 that may be a share in %
PATH = click.Path(path_type=Path)


class Finite(click.FloatRange):
    """A finite number in a range. NaN and infinity are rejected."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number. Raise a usage error for any other text."""
        number = _number(value)
        if not math.isfinite(number):
            share = _number(str(value).removesuffix("%")) / 100
            self.fail(f"{value} is not a finite number{self._instead(share)}", param, ctx)
        if why := _outside(self, number):
            share = number / 100 if number >= _LEAST_PERCENT else math.nan
            self.fail(f"{value} {why}{self._instead(share)}", param, ctx)
        return number

    def _instead(self, share: float) -> str:
        """Return "did you mean 0.5?" or the like if the number may be a share in %, else ""."""
        possible = self.max == 1.0 and math.isfinite(share) and not _outside(self, share)
        return did_you_mean(f"{share:g}") if possible else ""


def _number(text: Any) -> float:
    """Return the number of a text, or NaN."""
    try:
        return float(text)
    except ValueError:
        return math.nan


class Whole(click.IntRange):
    """A whole number in a range."""

    name = "whole number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number. Raise a usage error for any other text."""
        try:
            number = int(value)
        except ValueError:
            self.fail(f"{value} is not a whole number", param, ctx)
        if why := _outside(self, number):
            self.fail(f"{value} {why}", param, ctx)
        return number


def _outside(kind: click.FloatRange | click.IntRange, number: float) -> str:
    """Return what is wrong with a number outside a range; empty if it is in the range."""
    if kind.min is not None and kind.min_open and number <= kind.min:
        return f"is not above {kind.min:g}"
    if kind.min is not None and number < kind.min:
        return f"is less than {kind.min:g}"
    if kind.max is not None and number > kind.max:
        return f"is more than {kind.max:g}"
    return ""


class Url(click.types.StringParamType):
    """The URL of a server."""

    name = "url"
    schemes, kind = ("http", "https"), "a server, such as http://arm:8765"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the URL. Raise a usage error for any other text."""
        try:
            parts = urlsplit(str(value))
            valid = parts.scheme in self.schemes and parts.hostname and parts.port != 0
        except ValueError:
            valid = False
        if not valid:
            self.fail(f"{value!r} is not the URL of {self.kind}", param, ctx)
        return str(value)


class FleetUrl(Url):
    """The URL of the NATS server of a fleet."""

    schemes, kind = ("nats", "tls"), "a fleet, such as nats://127.0.0.1:4222"


AT_LEAST_0 = Finite(0)
ABOVE_0 = Finite(0, min_open=True)
