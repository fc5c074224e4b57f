"""The task executive: goals in, outcomes out. `armtree` exports its Python interface."""

import typing

if typing.TYPE_CHECKING:
    from .client.asynchronous import AsyncClient
    from .client.synchronous import Client
    from .client.values import Task
    from .errors import ClientError, GoalFailed, Refused, ServerUnreachable
    from .goals.events import Status
    from .goals.outcome import CancelResult

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
    """Import the client at its first use; the command line starts faster without it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import client

    return getattr(client, name)
