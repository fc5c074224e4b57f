"""Errors of a fleet. The root is FleetError."""

import re
from collections.abc import Sequence
from urllib.parse import urlsplit

from hardware import ArmtreeError
from hardware.loading.dataclass import dataclass

_NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")


def without_login(url: str) -> str:
    """Return a URL without user name and password, for logs and errors."""
    parts = urlsplit(url)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()


class FleetError(ArmtreeError):
    """The fleet failed. Root of the errors of a fleet."""

    code = "fleet.error"
    exit_status = 13
    hint = "`armtree fleet ls` lists the arms, and `armtree fleet jobs` the jobs"


class FleetUnreachable(FleetError, ConnectionError):
    """No NATS server answers."""

    code = "fleet.unreachable"
    hint = "`armtree fleet up` starts a fleet; --fleet URL or ARMTREE_FLEET names another one"

    def __init__(self, url: str, why: object) -> None:
        super().__init__(
            f"no fleet answers at {url}: {str(why).rstrip('.')}. Start one with armtree fleet up, "
            "or set its URL with --fleet URL or ARMTREE_FLEET"
        )


class FleetRefused(FleetError):
    """The NATS server refuses the token, the key, or an action of this role."""

    code = "fleet.refused"
    hint = "set ARMTREE_FLEET_TOKEN, or ARMTREE_FLEET_NKEY to the file of a key of the fleet"

    def __init__(self, url: str) -> None:
        super().__init__(
            f"the fleet at {url} refuses this program, or an action of its role; {self.hint}"
        )


class UntrustedFleet(FleetError):
    """The certificate of the NATS server is not trusted."""

    code = "fleet.untrusted"
    hint = (
        "set ARMTREE_FLEET_CA to the file of this certificate, or of the certificate that signed "
        "it, and use a name of the certificate in the URL"
    )

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"the certificate of the fleet at {url} is not trusted: {why.rstrip('.')}; {self.hint}"
        )


class BadCredentials(FleetError):
    """The file of the private key, or of the certificate of the fleet, is unusable."""

    code = "fleet.bad_credentials"
    hint = "correct the path; `armtree fleet key FILE` makes a key"

    def __init__(self, variable: str, path: str, why: object) -> None:
        super().__init__(f"{variable} names {path}: {why}; {self.hint}")


class FleetMissing(FleetError):
    """The libraries of the extra `fleet` are not installed."""

    code = "fleet.missing"
    hint = (
        "type `make fleet` in the repository, or install the wheel again with [fleet] behind its "
        "name"
    )

    def __init__(self, what: str) -> None:
        super().__init__(f"{what} is not installed; {self.hint}")


class FleetUnsafe(FleetError):
    """A fleet for other machines needs TLS and nkeys."""

    code = "fleet.unsafe"
    exit_status = 2
    hint = "give --tls-cert, --tls-key and --nkeys; `armtree fleet key` makes a key"

    def __init__(self, address: str) -> None:
        super().__init__(
            f"--bind {address} would let other machines move every arm of the fleet; {self.hint}"
        )


class NotStarted(FleetError):
    """The program nats-server does not start."""

    code = "fleet.not_started"
    hint = "see the end of the log; --nats-port chooses another port, --data another folder"


class BadName(FleetError):
    """The name of an arm or a pool is malformed."""

    code = "fleet.bad_name"
    exit_status = 2
    hint = "use 1 to 32 letters, digits, - and _"

    def __init__(self, kind: str, name: str) -> None:
        super().__init__(f"{name[:80]!r} is not the name of {kind}; {self.hint}")


def check_name(kind: str, name: str) -> str:
    """Return the name of an arm or a pool, which becomes a token of a NATS subject.

    Args:
        kind: Description of the named thing for the message, such as `an arm`.
        name: The name.

    Raises:
        BadName: The name is malformed.
    """
    if not _NAME.fullmatch(name):
        raise BadName(kind, name)
    return name


class NameTaken(FleetError):
    """Another worker has that name."""

    code = "fleet.name_taken"
    hint = "give another --name"

    def __init__(self, arm: str, url: str) -> None:
        super().__init__(f"another worker has the name {arm}, with the server {url}; {self.hint}")


class BadJob(FleetError):
    """A job is malformed."""

    code = "fleet.bad_job"
    exit_status = 4
    hint = "send the job with this version of `armtree fleet send`"


class PoolNotServed(FleetError):
    """No arm serves the pool."""

    code = "fleet.no_arm"
    exit_status = 4
    hint = "`armtree fleet ls` lists the arms; `armtree serve --fleet URL --pool POOL` adds one"

    def __init__(self, pool: str, served: Sequence[str]) -> None:
        others = ", ".join(served) or "none"
        super().__init__(
            f"no arm serves the pool {pool}, so nothing was sent; served pools: {others}; "
            f"{self.hint}"
        )


class DuplicateJob(FleetError):
    """A job with that id exists."""

    code = "fleet.duplicate"
    exit_status = 4
    hint = "`armtree fleet jobs` shows that job; give every job its own id"

    def __init__(self, identity: str) -> None:
        super().__init__(f"the job {identity} was sent before, and is not sent again; {self.hint}")


class UnknownJob(FleetError):
    """No known job has that id."""

    code = "fleet.unknown_job"
    exit_status = 4
    hint = "`armtree fleet jobs` lists the jobs"

    def __init__(self, identity: str) -> None:
        super().__init__(f"no job {identity} is known; {self.hint}")


class DeadlinePassed(FleetError):
    """A job was not started by its deadline."""

    code = "fleet.deadline"
    exit_status = 8
    hint = "send the job again if you still want it"

    def __init__(self, late: float) -> None:
        super().__init__(
            f"no arm was free before the deadline of the job, {late:.1f} s ago, so nothing moved"
        )


class TooLong(FleetError):
    """A job had not ended by its deadline, so it was canceled."""

    code = "fleet.too_long"
    exit_status = 8
    hint = "see in its recording what took long, or give the job more time"

    def __init__(self, seconds: float) -> None:
        super().__init__(
            f"the job had not ended {seconds:g} s after it was sent, so it was canceled"
        )


class ArmLost(FleetError):
    """The arm that had claimed a job is gone."""

    code = "fleet.arm_lost"
    hint = "check the arm before you send the job again"

    def __init__(self, arm: str, url: str, silence: float) -> None:
        super().__init__(
            f"{arm} ({url}) claimed this job, but has sent nothing for {silence:.0f} s. The arm "
            "may have moved; see its own recording"
        )


@dataclass(frozen=True, slots=True)
class Confirmation:
    """The answer of an arm to a request.

    Attributes:
        arm: POOL.NAME.
        error: Error of the request; empty if the request is done.
        goals: Identities of the goals that the request concerned.
        seconds: Time from the request to the answer [s].
    """

    arm: str
    error: str
    goals: tuple[str, ...]
    seconds: float


class NotConfirmed(FleetError):
    """Some arms did not confirm a request, or the queues are not held after a stop.

    Args:
        request: `stop`, `resume` or `cancel`.
        confirmed: The answers of the arms that confirmed.
        wanted: Number of arms that should confirm.
        missing: The arms that did not confirm, each with the reason.
        unheld: Why the queues are not held; empty if they are held.

    Attributes:
        confirmed, wanted, missing: The arguments of these names.
    """

    code = "fleet.not_confirmed"
    hint = "check these arms, and use their own pages or power switches"

    def __init__(
        self,
        request: str,
        confirmed: Sequence[Confirmation],
        wanted: int,
        missing: Sequence[str],
        unheld: str = "",
    ) -> None:
        words = f"{len(confirmed)} of {wanted} arms confirmed {request}"
        if missing:
            words += f"; not confirmed by {', '.join(missing)}"
        if unheld:
            words += f"; the queues are not held and still deliver jobs ({unheld})"
            again = f"type the {request} again"
            self.hint = f"{self.hint}; then {again}" if missing else again
        super().__init__(f"{words}; {self.hint}")
        self.confirmed, self.wanted, self.missing = tuple(confirmed), wanted, tuple(missing)
