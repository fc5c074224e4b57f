"""Arms and jobs of a fleet, as JSON objects and as lines."""

import asyncio
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from executive.fleet.values import Job, JobRecord, to_json
from hardware.printable import plural, printable

from .streams import echo

if TYPE_CHECKING:
    from executive.fleet.fleet_client import ArmRow, FleetClient


def job_row(found: Job | JobRecord) -> dict[str, Any]:
    """Return a job, or its record, as a JSON object."""
    plain = to_json(found)
    if isinstance(found, Job):
        return {"job": plain.pop("identity"), "state": "QUEUED", **plain}
    result = found.result and found.result.to_json() | {"hint": found.result.hint}
    return {**job_row(plain.pop("job")), **plain, "state": found.state, "result": result}


def job_text(found: Job | JobRecord) -> str:
    """Return a job, or its record, as a line, with its hint and its recording on further lines."""
    if isinstance(found, Job):
        return f"{found.identity}  QUEUED     task {found.task} for {found.pool}, {found.priority}"
    result, arm = found.result, found.arm or "no arm"
    text = f"{found.job.identity}  {found.state:<9}  task {found.job.task} on {arm}"
    if result is None:
        return text
    text += f" ({result.duration:.2f} s, {plural(result.frames, 'frame')})"
    if found.late:
        text += ", reported after the arm was lost"
    if result.code != "ok":
        text += f"\n  {result.message} [{result.code}]"
        text += f"\n  -> {result.hint}" if result.hint else ""
    return f"{text}\n  recording {result.recording} on {found.url}" if result.recording else text


def arms_table(rows: "Sequence[ArmRow]") -> list[str]:
    """Return the lines of a table of arms."""
    if not rows:
        return ["no arm has joined; `armtree serve --fleet URL --name NAME` adds an arm"]
    keys = {"arm": "ARM", "state": "STATE", "last": "LAST", "url": "SERVER", "job": "JOB"}
    found = (keys, *(row.to_json() for row in rows))
    table = [[str(row[key]) or "-" for key in keys] for row in found]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(map(str.ljust, line, widths)).rstrip() for line in table]


async def top(client: "FleetClient") -> None:
    """Show the arms and the queue once a second, until Ctrl-C."""
    from rich.live import Live
    from rich.text import Text

    is_screen = sys.stdout.isatty()
    with Live(screen=True, auto_refresh=False) if is_screen else nullcontext() as live:
        while True:
            number, _ = await client.queued(0)
            lines = [f"Queued jobs: {number}", *arms_table(await client.arms())]
            if live:
                live.update(Text("\n".join(map(printable, lines))), refresh=True)
            else:
                echo(*lines)
            await asyncio.sleep(1.0)
