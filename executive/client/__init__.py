"""Talking to a server from Python: `with Client() as arm: arm.run(1)`, or with `await`."""

from executive.goals.events import Status
from executive.goals.outcome import CancelResult

from .asynchronous import AsyncClient
from .errors import ClientError, GoalFailed, Refused, ServerUnreachable
from .requests import OpenQuestion, Task
from .synchronous import Client

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
