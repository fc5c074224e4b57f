"""The task executive: goals in, outcomes out. Its public face is the command line.

Other programs talk to its server: `from executive import Client`.
"""

import typing

if typing.TYPE_CHECKING:
    from .client import (
        AsyncClient,
        CancelResult,
        Client,
        ClientError,
        GoalFailed,
        Refused,
        ServerUnreachable,
        Status,
        Task,
    )

__all__ = [
    "AsyncClient",
    "CancelResult",
    "Client",
    "ClientError",
    "GoalFailed",
    "Refused",
    "ServerUnreachable",
    "Status",
    "Task",
]


def __getattr__(name: str) -> typing.Any:
    """Load the client for whoever asks for it; the command line starts faster without."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import client

    return getattr(client, name)
