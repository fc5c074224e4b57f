"""The end of this process. A skill cannot end it: its goal would have no result, and status 0."""

import os
from typing import NoReturn

end_process = os._exit  # ends it at once, from any thread
_OWN = os.getpid()


def forbid_exit() -> None:
    """Make `os._exit` raise SystemExit in this process. Forked processes can still end."""
    os._exit = _refuse_exit


def _refuse_exit(status: int) -> NoReturn:
    if os.getpid() != _OWN:
        end_process(status)
    raise SystemExit(f"os._exit({status}) would end armtree without a result; raise an exception")
