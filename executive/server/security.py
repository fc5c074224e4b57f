"""Closed by default: who may ask at all, and what every answer says to browsers."""

import hmac
import re
from collections.abc import Iterable
from dataclasses import dataclass
from ipaddress import ip_address

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import Message, Send

from executive.errors import Unauthorized, WrongHost, WrongOrigin

from .token_file import HTTP_PORT

HAS_TOKEN = "has_token"  # of a request's state: whether its sender does

_HAS_PORT = re.compile(r"[^:]:\d+$")
_FOR_BROWSERS = {
    "cache-control": "no-store",
    "content-security-policy": "default-src 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


@dataclass(frozen=True, slots=True)
class AccessRules:
    """Who may ask.

    Attributes:
        hosts: What Host may say, in lower case.
        origins: What Origin may say, where there is one.
        token: For whatever changes state.
        exposed: Whether others than this machine can connect; then reading needs the token too.
    """

    hosts: frozenset[str]
    origins: frozenset[str]
    token: str
    exposed: bool

    def check_source(self, headers: Headers, authority: str | None = None) -> None:
        """Refuse names that are not ours, as a rebound DNS name is, and foreign pages.

        Args:
            headers: Of the request.
            authority: What its target names as the server; None where it is a path alone.

        Raises:
            Forbidden: The Host or the Origin is another one.
        """
        named = [host.lower() for host in headers.getlist("host")]
        one = len(named) == 1
        named += [] if authority is None else [authority.lower()]
        if not one or not self.hosts.issuperset(named):
            raise WrongHost(
                f"Host {', '.join(named) or 'missing'} is not this server",
                f"ask {' or '.join(sorted(self.hosts))}; serve --host NAME adds one",
            )
        origins = headers.getlist("origin")
        if any(origin not in self.origins for origin in origins) or len(origins) > 1:
            raise WrongOrigin(
                f"pages of {', '.join(origins)} may not ask this server",
                "serve --origin URL lets them",
            )

    def has_token(self, headers: Headers) -> bool:
        """Whether somebody shows the token."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        right = hmac.compare_digest(given.strip().encode(), self.token.encode())
        return scheme.lower() == "bearer" and right

    def check_token(self, headers: Headers) -> None:
        """Refuse whoever does not show the token.

        Raises:
            Unauthorized: It is missing or wrong.
        """
        if not self.has_token(headers):
            given = headers.get("authorization")
            raise Unauthorized(
                "the token is wrong" if given else "this needs the server's token",
                "give it as ARMTREE_TOKEN, or in HTTP send Authorization: Bearer TOKEN; the server "
                "printed it when it started",
            )


def names(addresses: Iterable[str], port: int) -> frozenset[str]:
    """What Host may say for these names and addresses on a port, or on the one they name."""
    known = {_bracketed(name.lower()) for name in addresses}
    here = {host for host in known if not _HAS_PORT.search(host)}
    with_port = {f"{host}:{port}" for host in here}
    return frozenset((known - here) | with_port | (here if port == HTTP_PORT else set()))


def is_loopback(address: str) -> bool:
    """Whether only this machine can connect to an address.

    Raises:
        ValueError: It is no address.
    """
    return ip_address(address).is_loopback


def _bracketed(name: str) -> str:
    return f"[{name}]" if name.count(":") > 1 and not name.startswith("[") else name


def with_security_headers(send: Send) -> Send:
    """Have every answer tell browsers to keep to the strict side."""

    async def send_hardened(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _FOR_BROWSERS.items():
                headers.setdefault(name, value)
        await send(message)

    return send_hardened
