"""Use a server from Python: `with Client() as arm: arm.run(1)`, or AsyncClient with `await`."""

from executive.errors import ClientError, GoalFailed, Refused, ServerUnreachable
from executive.goals.events import Status
from executive.goals.outcome import CancelResult

from .asynchronous import AsyncClient
from .synchronous import Client
from .values import OpenQuestion, Task

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
