"""How tasks ended last, as their recordings tell."""

import re
from pathlib import Path

import logs

_NAME = re.compile(r"(\d{8}T\d{6}\.\d{3}Z)-(\d+)\.mcap")
_MOST = 200  # recordings that are opened; a list must not take long


def last_outcomes(folder: Path) -> dict[int, str]:
    """The last outcome by task number, as far as recordings in a folder tell."""
    latest: dict[int, tuple[str, Path]] = {}
    for path in folder.iterdir() if folder.is_dir() else ():
        if found := _NAME.fullmatch(path.name):
            number = int(found[2])
            latest[number] = max(latest.get(number, ("", path)), (found[1], path))
    newest = sorted(latest.items(), key=lambda item: item[1], reverse=True)[:_MOST]
    return {number: _outcome(time, path) for number, (time, path) in newest}


def _outcome(time: str, path: Path) -> str:
    when = f"{time[:4]}-{time[4:6]}-{time[6:8]} {time[9:11]}:{time[11:13]} UTC"
    try:
        for message in logs.read(path, ["/result"]):
            return f"{message.fields()['state']} {when}"
    except logs.LogError:
        pass  # said below: what cannot be read tells nothing
    return f"unknown, {path.name} is not complete"
