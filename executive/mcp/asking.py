"""Questions to the person behind a client ("elicitation" in the protocol).

In protocol version 2025-11-25 and earlier, the server asks during a call. From version 2026-07-28
on, a call ends with the question, and the client repeats the call with the answer.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from mcp.server import ServerRequestContext
from mcp_types import (
    CallToolRequestParams,
    ElicitRequest,
    ElicitRequestFormParams,
    ElicitResult,
    InputRequests,
    InputRequiredResult,
)

from hardware.loading.dataclass import dataclass

_REPEATS_SINCE = "2026-07-28"
_KEY = "answer"


class MustRepeat(Exception):
    """The client must repeat the call with an answer.

    Attributes:
        result: Result of the present call.
    """

    def __init__(self, result: InputRequiredResult) -> None:
        self.result = result


@dataclass(frozen=True, slots=True)
class Person:
    """The person behind a client, during one call.

    Args:
        context: Context of the call.
        params: Parameters of the call.
    """

    context: ServerRequestContext[Any, Any]
    params: CallToolRequestParams

    @property
    def can_answer(self) -> bool:
        """True if the client can show a question to a person."""
        capabilities = self.context.session.client_capabilities
        found = capabilities.elicitation if capabilities else None
        shows = found is not None and (found.form is not None or found.url is None)
        return shows and (self.repeats or self.context.session.can_send_request)

    @property
    def repeats(self) -> bool:
        """True if a question ends the call, and the client repeats it with the answer."""
        return self.context.protocol_version >= _REPEATS_SINCE

    @property
    def state(self) -> Mapping[str, Any]:
        """The `state` that `ask` received before the call was repeated; empty for a first call.

        The SDK encrypts it, so a client cannot forge it.
        """
        found: Mapping[str, Any] = json.loads(self.params.request_state or "{}")
        return found

    @property
    def answer(self) -> str | None:
        """The answer in a repeated call; None if the person gave no answer."""
        return _words((self.params.input_responses or {}).get(_KEY))

    async def ask(self, text: str, choices: Sequence[str], state: Mapping[str, Any]) -> str | None:
        """Ask the person.

        Args:
            text: The question.
            choices: Possible answers; empty for any text.
            state: State for the repeated call.

        Returns:
            The answer, or None if the person gives no answer.

        Raises:
            MustRepeat: The client must repeat the call with the answer.
        """
        one = {"type": "string", "title": "Answer", **({"enum": [*choices]} if choices else {})}
        schema = {"type": "object", "properties": {_KEY: one}, "required": [_KEY]}
        if self.repeats:
            form = ElicitRequestFormParams(message=text, requested_schema=schema)
            asked: InputRequests = {_KEY: ElicitRequest(params=form)}
            raise MustRepeat(
                InputRequiredResult(input_requests=asked, request_state=json.dumps(state))
            )
        session, related = self.context.session, self.context.request_id
        return _words(await session.elicit_form(text, schema, related))


def _words(answer: object) -> str | None:
    if not isinstance(answer, ElicitResult) or answer.action != "accept":
        return None
    words = (answer.content or {}).get(_KEY)
    return words if isinstance(words, str) else None
