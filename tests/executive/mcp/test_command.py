"""`armtree mcp` without its packages."""

import sys

import pytest
from click.testing import CliRunner

from executive.cli.main import cli


def test_without_its_packages_the_command_says_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [name for name in sys.modules if name.startswith(("executive.mcp.", "mcp."))]:
        monkeypatch.delitem(sys.modules, name)  # that other tests have loaded
    monkeypatch.setitem(sys.modules, "mcp", None)
    result = CliRunner().invoke(cli, ["mcp"])
    assert result.exit_code == 2
    assert "install the wheel again with [mcp] behind its name" in result.output
