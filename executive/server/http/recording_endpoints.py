"""The endpoints without an arm: sign-in and recordings."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import islice
from json import JSONEncoder
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from executive.api.operations import OPERATIONS
from executive.api.schemas import MAX_LISTED
from executive.errors import NotFound
from executive.server.playback.recording_list import RecordingFilter, RecordingFolder
from executive.server.playback.seek import POINTS, Timeline
from executive.server.sign_in import SignIn
from hardware import Clock
from hardware.installed import version
from logs import RecordingError
from logs.reading.file_state import being_written

from .openapi import document

Json = Mapping[str, Any]

_ENCODER = JSONEncoder(allow_nan=False, separators=(",", ":"))


class RecordingEndpoints:
    """Answers requests for recordings. `Endpoints` describes its methods.

    Args:
        recordings: The folder of recordings.
        sign_in: Signs browsers in.
        clock: Time source.
    """

    has_arm = False

    def __init__(self, recordings: Path, sign_in: SignIn, clock: Clock) -> None:
        self._sign_in = sign_in
        self._recordings = RecordingFolder(recordings, clock)
        self._document = document(o for o in OPERATIONS.values() if hasattr(self, o.name))

    async def health(self) -> Json:
        return {"ok": True, "version": version("armtree"), "arm": self.has_arm}

    async def session(self) -> Json:
        return {"ok": True}

    async def sign_in(self, code: str) -> Json:
        return {"token": self._sign_in.redeem(code)}

    async def link(self) -> Json:
        return {"url": self._sign_in.link()}

    async def mesh(self, digest: str) -> bytes:
        for timeline in self._recordings.timelines:
            if found := await asyncio.to_thread(timeline.mesh, digest):
                return found
        for scene in self._recordings.scenes:
            try:
                return await asyncio.to_thread(scene.mesh, digest)
            except NotFound:
                continue
        raise NotFound(f"no robot has the mesh {digest}")

    async def recordings(
        self,
        search: str = "",
        task: int | None = None,
        state: str = "",
        since: int = 0,
        until: int = 2**63 - 1,
        before: str = "",
        limit: int = MAX_LISTED,
    ) -> Json:
        query = RecordingFilter(search, task, state, since, until, before, limit)
        return {"recordings": await asyncio.to_thread(self._recordings.rows, query)}

    async def recording(self, name: str) -> Json:
        return (await asyncio.to_thread(self._recordings.timeline, name)).to_json()

    async def recorded_events(self, name: str, at: float = 0.0) -> Response:
        return await asyncio.to_thread(self._answer, name, lambda timeline: timeline.events(at))

    async def recorded_series(self, name: str, points: int = POINTS) -> Response:
        return await asyncio.to_thread(self._answer, name, lambda timeline: timeline.series(points))

    def _answer(self, name: str, read: Callable[[Timeline], Json]) -> Response:
        """Return what `read` makes of the timeline of a recording. Call this on a thread."""
        found = read(self._recordings.timeline(name))
        try:
            text = _text(found)
        except RecordingError:  # also a ValueError
            raise
        except ValueError as cause:
            what = "has a number that is not finite; another program recorded it"
            raise RecordingError(self._recordings.path(name), what) from cause
        return Response(text, media_type="application/json")

    async def recorded_robot(self, name: str) -> Json:
        scene = await asyncio.to_thread(self._recordings.scene, name)
        return await asyncio.to_thread(scene.description)

    async def recorded_nodes(self, name: str) -> Json:
        return {"nodes": await asyncio.to_thread(self._recordings.nodes, name)}

    async def recording_file(self, request: Request, name: str) -> Response:
        path, kind = self._recordings.path(name), "application/octet-stream"
        if await asyncio.to_thread(being_written, path):
            head = {"Content-Disposition": f"attachment; filename*=utf-8''{quote(name)}"}
            return StreamingResponse(_pieces(path), headers=head, media_type=kind)
        return FileResponse(path, media_type=kind, filename=name)

    async def verify_recording(self, name: str) -> Json:
        return await asyncio.to_thread(self._recordings.verify, name)

    async def pin_recording(self, name: str, on: bool = True) -> Json:
        return await asyncio.to_thread(self._recordings.pin, name, on)

    async def delete_recording(self, name: str) -> Json:
        await asyncio.to_thread(self._recordings.delete, name)
        return {"name": name}

    async def restore_recording(self, name: str) -> Json:
        return await asyncio.to_thread(self._recordings.restore, name)

    async def openapi(self) -> Json:
        return self._document


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield the content of a file whose size may change."""
    with path.open("rb") as stream:
        yield from iter(partial(stream.read, FileResponse.chunk_size), b"")


def _text(values: Json) -> str:
    """Return a JSON object. Iterators are encoded piece by piece, and become arrays.

    Raises:
        ValueError: A number is not finite.
    """
    fields = []
    for key, value in values.items():
        is_array = isinstance(value, Iterator)
        text = f"[{','.join(map(_encoded, value))}]" if is_array else _encoded(value)
        fields.append(f'"{key}":{text}')
    return f"{{{','.join(fields)}}}"


def _encoded(value: Any) -> str:
    """Return a value as JSON. It is encoded in pieces, so that other threads can run between."""
    pieces = _ENCODER.iterencode(value)
    return "".join(iter(lambda: "".join(islice(pieces, 10_000)), ""))
