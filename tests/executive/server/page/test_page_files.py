"""The files of the page: what is served, with which headers."""

import gzip
import http.client
import subprocess
from pathlib import Path

import pytest

from executive.server import page
from executive.server.page.page_files import POLICY
from tests.support.servers.serving import Serve, Served

STATIC = Path(page.__file__).parent / "static"

pytest_plugins = ["tests.support.servers.server_fixtures"]


def fetch(served: Served, path: str, **headers: str) -> tuple[http.client.HTTPResponse, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", served.server.port, timeout=10)
    try:
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        return response, response.read()
    finally:
        connection.close()


def test_files_are_compressed_and_sent_once(serve: Serve) -> None:
    served = serve(active=False, expose=True)  # they hold no secret
    response, data = fetch(served, "/")
    assert response.headers["content-type"] == "text/html; charset=utf-8"
    assert data == (STATIC / "index.html").read_bytes()
    tag = response.headers["etag"]
    packed = fetch(served, "/", **{"accept-encoding": "gzip"})[1]
    assert gzip.decompress(packed) == data
    again, nothing = fetch(served, "/", **{"if-none-match": tag})
    assert (again.status, nothing) == (304, b"")


def test_the_policy_allows_only_files_of_this_server(serve: Serve) -> None:
    served = serve(active=False)
    for path in ("/", "/page/main.js", "/page/style.css"):
        headers = fetch(served, path)[0].headers
        assert headers["content-security-policy"] == POLICY
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cross-origin-opener-policy"] == "same-origin"
    assert "unsafe" not in POLICY
    assert {"default-src 'none'", "script-src 'self'", "frame-ancestors 'none'"} <= set(
        POLICY.split("; ")
    )


def test_nothing_else_is_served(serve: Serve) -> None:
    served = serve(active=False)
    for path in (
        *(
            "/page/",
            "/page/none.js",
            "/page/../page_files.py",
            "/page/%2e%2e/page_files.py",
            "/index.html",
        ),
        *("/page/static/main.js", "/page//main.js", "/page/main.js/"),
    ):
        assert fetch(served, path)[0].status == 404


def test_the_page_asks_for_all_of_its_code_at_once() -> None:
    """Otherwise the browser finds one module after another."""
    modules = {str(path.relative_to(STATIC)) for path in STATIC.rglob("*.js")}
    for name in modules - {"libraries/libraries.js"}:  # these are loaded later
        assert f'"page/{name}"' in (STATIC / "index.html").read_text()


def test_the_first_view_is_small() -> None:
    sizes = {path.name: len(gzip.compress(path.read_bytes())) for path in STATIC.rglob("*.*")}
    assert sum(sizes.values()) < 400_000
    assert sizes["libraries.js"] < 170_000


@pytest.mark.slow
def test_the_libraries_are_those_of_the_lock(tmp_path: Path) -> None:
    folder = Path(page.__file__).parent
    if not (folder / "node_modules" / "esbuild").is_dir():
        pytest.skip("esbuild is not installed")
    (tmp_path / "fonts").mkdir()
    subprocess.run(["node", "build.js", tmp_path], cwd=folder, check=True)
    built = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    assert [path.name for path in built] == [
        "LICENSE.txt",
        "inter.woff2",
        "libraries.js",
        "libraries.txt",
        "uplot.css",
    ]
    for path in built:
        assert path.read_bytes() == (STATIC / path.relative_to(tmp_path)).read_bytes()


def test_other_sites_get_no_file(serve: Serve) -> None:
    served = serve(active=False)
    assert fetch(served, "/", host="evil.example")[0].status == 403
    assert fetch(served, "/page/main.js", origin="http://evil.example")[0].status == 403
