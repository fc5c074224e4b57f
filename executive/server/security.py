"""Security of the server: Host, Origin and token, and headers that protect browsers."""

import hmac
import re
from collections.abc import Iterable, Mapping
from ipaddress import ip_address
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import Message, Scope, Send

from executive.api.token_file import HTTP_PORT
from executive.errors import Unauthorized, WrongHost, WrongOrigin
from hardware.loading.dataclass import dataclass
from hardware.printable import printable

_HAS_TOKEN = "has_token"  # key in a request's state
MAX_CLIENT = 120  # largest number of characters of a client's name
_HAS_PORT = re.compile(r"[^:]:\d+$")
SECURITY_HEADERS = {
    "cache-control": "no-store",
    "content-security-policy": "default-src 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


def client_of(headers: Headers) -> str:
    """Return the name of a client for the log and recordings; empty if it gives none."""
    name = headers.get("user-agent", "")
    if name.startswith("Mozilla/"):  # every browser begins like this
        return "a browser"
    return printable(name[:MAX_CLIENT])


@dataclass(frozen=True, slots=True)
class AccessRules:
    """Rules of access to the server.

    Attributes:
        hosts: Accepted values of the Host header, in lower case.
        origins: Accepted values of the Origin header; requests without one are accepted too.
        token: Token for every request that changes something.
        exposed: True if other machines can connect. Reading then also needs the token.
    """

    hosts: frozenset[str]
    origins: frozenset[str]
    token: str
    exposed: bool

    def check_source(self, headers: Headers, authority: str | None = None) -> None:
        """Refuse requests of other sites' pages, and requests through DNS rebinding.

        Args:
            headers: Headers of the request.
            authority: Server named by the request's target, or None if the target is a path.

        Raises:
            WrongHost: The Host is not accepted.
            WrongOrigin: The Origin is not accepted.
        """
        hosts = [host.lower() for host in headers.getlist("host")]
        single = len(hosts) == 1
        hosts += [] if authority is None else [authority.lower()]
        if not single or not self.hosts.issuperset(hosts):
            raise WrongHost(
                f"the Host header, {', '.join(hosts) or 'missing'}, does not name this server",
                f"send {' or '.join(sorted(self.hosts))}; serve --host NAME adds a name",
            )
        origins = headers.getlist("origin")
        if any(origin not in self.origins for origin in origins) or len(origins) > 1:
            raise WrongOrigin(
                f"pages of {', '.join(origins)} may not use this server",
                "serve --origin URL allows the pages of a site",
            )

    def has_token(self, headers: Headers) -> bool:
        """Return True if the headers contain the right token."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        right = hmac.compare_digest(given.strip().encode(), self.token.encode())
        return scheme.lower() == "bearer" and right

    def check_token(self, headers: Headers) -> None:
        """Refuse a request without the token.

        Raises:
            Unauthorized: The token is missing or wrong.
        """
        if not self.has_token(headers):
            given = headers.get("authorization")
            raise Unauthorized(
                "the token is wrong" if given else "this request needs the server's token",
                "set ARMTREE_TOKEN, or send the HTTP header Authorization: Bearer TOKEN; the "
                "server printed the token when it started",
            )


def mark_authenticated(scope: Scope) -> None:
    """Mark a request that contains the token."""
    scope["state"][_HAS_TOKEN] = True


def is_authenticated(scope: Mapping[str, Any]) -> bool:
    """Return True if a request contains the token."""
    return _HAS_TOKEN in scope["state"]


def host_names(addresses: Iterable[str], port: int) -> frozenset[str]:
    """Return the values of Host for names and addresses that may contain their own port.

    Args:
        addresses: Names, IP addresses, or one of them with `:port`.
        port: TCP port for addresses without a port.
    """
    known = {_bracketed(name.lower()) for name in addresses}
    without_port = {host for host in known if not _HAS_PORT.search(host)}
    with_port = {f"{host}:{port}" for host in without_port}
    default = without_port if port == HTTP_PORT else set()
    return frozenset((known - without_port) | with_port | default)


def is_loopback(address: str) -> bool:
    """Return True if only this machine can connect to an IP address.

    Raises:
        ValueError: The text is not an IP address.
    """
    return ip_address(address).is_loopback


def _bracketed(name: str) -> str:
    return f"[{name}]" if name.count(":") > 1 and not name.startswith("[") else name


def with_security_headers(send: Send) -> Send:
    """Return a `send` that adds the security headers for browsers to every answer."""

    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in SECURITY_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return send_with_headers
