"""The files of the page, as routes of the server."""

import gzip
import hashlib
from functools import cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

PREFIX = "/page/"
INDEX = "index.html"

# No inline code or style, no content from other servers, no use of the page in a frame.
POLICY = "; ".join(
    (
        "default-src 'none'",
        *(f"{kind}-src 'self'" for kind in ("script", "style", "connect", "img", "font")),
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types 'none'",
    )
)
_TYPES = {
    ".css": "text/css",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".woff2": "font/woff2",
}


class PageFile:
    """A file of the page.

    Args:
        path: The file. It is read once.
    """

    def __init__(self, path: Traversable) -> None:
        self._type = _TYPES[f".{path.name.rpartition('.')[2]}"]
        self._data = path.read_bytes()
        self._tag = f'"{hashlib.sha256(self._data).hexdigest()[:32]}"'

    @cached_property
    def _compressed(self) -> bytes:
        return gzip.compress(self._data, mtime=0)

    async def answer(self, request: Request) -> Response:
        """Return the file, or 304 if the browser has it."""
        headers = {
            "cache-control": "no-cache",  # browsers must check every time; the tag makes this cheap
            "content-security-policy": POLICY,
            "cross-origin-opener-policy": "same-origin",
            "etag": self._tag,
            "vary": "accept-encoding",
        }
        if request.headers.get("if-none-match") == self._tag:
            return Response(status_code=304, headers=headers)
        data = self._data
        if "gzip" in request.headers.get("accept-encoding", ""):
            data, headers["content-encoding"] = self._compressed, "gzip"
        return Response(data, headers=headers, media_type=self._type)


def page_routes() -> list[Route]:
    """Return the route of the HTML, and one for all other files."""
    found = {name: PageFile(path) for name, path in _walk(files(__package__) / "static")}
    index = found.pop(INDEX)

    async def answer(request: Request) -> Response:
        if file := found.get(request.path_params["name"]):
            return await file.answer(request)
        raise HTTPException(404)

    return [Route("/", index.answer), Route(f"{PREFIX}{{name:path}}", answer)]


def _walk(folder: Traversable, above: str = "") -> list[tuple[str, Traversable]]:
    found = []
    for path in folder.iterdir():
        name = f"{above}{path.name}"
        found += _walk(path, f"{name}/") if path.is_dir() else [(name, path)]
    return found
