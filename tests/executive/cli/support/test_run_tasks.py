"""What `armtree run` says of the servers of this machine."""

from pathlib import Path

from tests.support.command_line.typed import typed
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]

OTHER = "task: 11\nname: other\ndescription: Do nothing.\ntree:\n  Succeed: {}\n"


def test_a_virtual_run_offers_the_server_only_what_it_has(serve: Serve, tmp_path: Path) -> None:
    """The unknown parameter ends each run before the board boots."""
    served, mine = serve(active=False), tmp_path / "mine"
    mine.mkdir()
    (mine / "11_other.yaml").write_text(OTHER)

    def note(*words: str) -> str:
        out = typed(tmp_path, "run", *words, "--set", "x=1", "--port", "virtual")[1]
        return next((line for line in out.splitlines() if line.startswith("Note")), "")

    url, trees = served.server.url, ("--trees", str(served.tasks))
    assert note("11", *trees) == (
        f"Note: this is not the arm of the server {url}; for that, give armtree send 11 --wait "
        f"--set x=1 --server {url}"
    )
    assert note("99", *trees) == ""
    assert note("11", "--trees", str(mine)) == ""
    assert note("1", "--robot", "so101") == ""
