"""Makes `synchronous.py` of the client from `asynchronous.py`; run it with `python -m`."""

import re
import subprocess
import sys

from tests.support.paths import ROOT

SOURCE = ROOT / "executive/client/asynchronous.py"
TARGET = ROOT / "executive/client/synchronous.py"

HEADER = '''"""The client for ordinary programs.

`python -m tests.support.generated.sync_client` makes this file from `asynchronous.py`.
"""'''

# Pattern and replacement, applied in this order
REPLACED = [
    (r'\A""".*?"""', HEADER),
    (r"A client of a server, for programs that use asyncio", "A client of a server"),
    (r"as an asynchronous context\.", "as a context; any thread may call."),
    (r"\basync (def|with|for)\b", r"\1"),
    (r"\bawait ", ""),
    (r"\basync_posted\b", "posted"),
    (r"\basynccontextmanager\b", "contextmanager"),
    (r"\bAsyncIterator\b", "Iterator"),
    (r"\bAsyncClient\b", "Client"),
    (r"\bAsyncBackend\b", "Backend"),
    (r"\bAsyncConnectionPool\b", "ConnectionPool"),
    (r"__a(enter|exit)__", r"__\1__"),
    (r"\ba(iter_stream|close)\b", r"\1"),
    (r"\banext\b", "next"),
    (r"for event in events\.read\(piece\):\s+yield event", "yield from events.read(piece)"),
]


def synchronous() -> str:
    """Return the text of the synchronous client."""
    text = SOURCE.read_text()
    for pattern, replacement in REPLACED:
        text, count = re.subn(pattern, replacement, text, flags=re.DOTALL)
        assert count, f"{pattern} is not in {SOURCE}"
    for command in (["check", "--quiet", "--fix-only", "--select", "I"], ["format", "--quiet"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(TARGET), "-"]
        text = subprocess.run(
            ruff, input=text, capture_output=True, text=True, check=True, cwd=ROOT
        ).stdout
    return text


if __name__ == "__main__":
    TARGET.write_text(synchronous())
