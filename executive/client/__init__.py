"""Talking to a server from Python: `with Client() as arm: arm.run(1)`, or with `await`."""

from .aio import AsyncClient
from .asks import CancelResult, OpenQuestion, Status, Task
from .errors import ClientError, GoalFailed, Refused, ServerUnreachable
from .sync import Client

__all__ = [
    "AsyncClient",
    "CancelResult",
    "Client",
    "ClientError",
    "GoalFailed",
    "OpenQuestion",
    "Refused",
    "ServerUnreachable",
    "Status",
    "Task",
]
