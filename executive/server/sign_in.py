"""Links that sign a browser in, without a password."""

import secrets

from executive.errors import WrongCode

MAX_CODES = 16  # largest number of unused links; older links stop working


class SignIn:
    """Makes links with a code that works once, and exchanges codes for the token.

    The code is in the fragment of the link, which browsers send to no server.

    Args:
        url: URL of the server.
        token: Token of the server, for one run of the server.
    """

    def __init__(self, url: str, token: str) -> None:
        self._url, self._token = url, token
        self._unused: list[str] = []

    def link(self) -> str:
        """Return a new link to the page."""
        code = secrets.token_urlsafe(16)
        self._unused = [*self._unused, code][-MAX_CODES:]
        return f"{self._url}/#code={code}"

    def redeem(self, code: str) -> str:
        """Return the token for an unused code.

        Raises:
            WrongCode: The code is unknown or already used.
        """
        if code not in self._unused:
            raise WrongCode("this link is unknown, or was opened before")
        self._unused.remove(code)
        return self._token
