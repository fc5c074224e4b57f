"""An editor, as far as it takes one to ask the YAML language server of what it underlines."""

import json
import subprocess
from pathlib import Path
from typing import Any, Self

from tests.support.paths import PEERS

_SETTINGS = {"validate": True, "completion": True, "schemaStore": {"enable": False}}


class LanguageServer:
    """A language server on the pipe of an editor; used as a context."""

    def __enter__(self) -> Self:
        """Start it."""
        server = str(PEERS / "node_modules/yaml-language-server/bin/yaml-language-server")
        self._process = subprocess.Popen(
            ["node", server, "--stdio"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._asked = 0
        able = {"workspace": {"configuration": True, "didChangeConfiguration": {}}}
        self._ask("initialize", {"processId": None, "rootUri": None, "capabilities": able})
        self._tell("initialized", {})
        self._tell("workspace/didChangeConfiguration", {"settings": {"yaml": _SETTINGS}})
        return self

    def __exit__(self, *raised: object) -> None:
        """End it."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.kill()
        self._process.wait()
        self._process.stdin.close()
        self._process.stdout.close()

    def underlined(self, path: Path) -> list[tuple[int, str]]:
        """What it finds wrong with a file: the line, from 1, and why."""
        text = {"uri": path.as_uri(), "languageId": "yaml", "version": 1, "text": path.read_text()}
        self._tell("textDocument/didOpen", {"textDocument": text})
        found = self._until(
            lambda said: (
                said.get("method") == "textDocument/publishDiagnostics"
                and said["params"]["uri"] == path.as_uri()
            )
        )["params"]["diagnostics"]
        return [(each["range"]["start"]["line"] + 1, each["message"]) for each in found]

    def completed(self, path: Path, line: int, column: int) -> set[str]:
        """What it offers at a place of a file that it was shown; line and column from 1."""
        at = {"line": line - 1, "character": column - 1}
        answer = self._ask(
            "textDocument/completion", {"textDocument": {"uri": path.as_uri()}, "position": at}
        )
        return {item["label"] for item in answer["items"]}

    def _ask(self, method: str, parameters: Any) -> Any:
        self._asked += 1
        asked = self._asked
        self._send({"id": asked, "method": method, "params": parameters})
        return self._until(lambda said: said.get("id") == asked and "result" in said)["result"]

    def _tell(self, method: str, parameters: Any) -> None:
        self._send({"method": method, "params": parameters})

    def _send(self, message: dict[str, Any]) -> None:
        assert self._process.stdin
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self._process.stdin.flush()

    def _until(self, wanted: Any) -> Any:
        while not wanted(said := self._receive()):
            if said.get("method") == "workspace/configuration":
                asked = [item.get("section") for item in said["params"]["items"]]
                settings = [_SETTINGS if section == "yaml" else {} for section in asked]
                self._send({"id": said["id"], "result": settings})
            elif "id" in said and "method" in said:
                self._send({"id": said["id"], "result": None})
        return said

    def _receive(self) -> dict[str, Any]:
        assert self._process.stdout
        length = 0
        while line := self._process.stdout.readline().strip():
            name, _, value = line.partition(b":")
            length = int(value) if name.lower() == b"content-length" else length
        assert length, "the language server has ended"
        message: dict[str, Any] = json.loads(self._process.stdout.read(length))
        return message
