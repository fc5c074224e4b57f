"""Letting time pass, until the recordings of a bench are finished, and clearing them away."""

from pathlib import Path

from executive.recording.recordings import is_server_recording
from hardware import Clock, RealClock
from logs.reading.file_state import being_written


def rest(clock: Clock, seconds: float) -> None:
    """Let time pass."""
    signal, until = clock.signal(), clock.now() + seconds
    with signal:
        while clock.now() < until:
            signal.wait(until)


def sweep(folder: Path) -> None:
    """Recordings of ten thousand runs would fill the disk; those that are surely finished go."""
    for path in sorted(folder.glob("*Z-2[12].mcap"))[:-100]:
        path.unlink()


def finished(folder: Path) -> None:
    """Wait until the recordings of all goals are."""
    while any(
        being_written(path) for path in folder.glob("*.mcap") if not is_server_recording(path)
    ):
        rest(RealClock(), 0.01)


def at_rest(folder: Path) -> None:
    """Wait until all recordings are finished, and what finished them has let them go."""
    finished(folder)
    rest(RealClock(), 0.5)
