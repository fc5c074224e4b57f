"""A person who does what the messages say, and nothing else, until the arm moves again."""

import re

from .site import Site

_STEPS = 10
_SHOWN = 8
# What a message says, and what the person does then. A command in backquotes is typed.
_HANDS = re.compile(
    r"cable|[Uu]nplug the board|[Pp]lug the board in|the power|its power|power supply|off and on"
)
_COMMAND = re.compile(r"`armtree ([^`]+)`")
_BOTH = re.compile(r"configure(?: it)? and activate")
_ONE = re.compile(r"\b(?:activate it|configure it|activate again)\b")
_AGAIN = re.compile(r"run again|send (?:it|the request|the goal) again|plan again|try again|moment")
_WAIT = re.compile(r"wait for (?:it|some)|cancel")


def works(site: Site, strict: bool = True) -> bool:
    """Follow the messages until a short motion succeeds.

    Args:
        site: The server and its board.
        strict: Whether it is a problem if that never happens; not while others use the server.

    Returns:
        True if the person had to do something, and the motion then succeeded.
    """
    trail: list[str] = []
    for _ in range(_STEPS if strict else 2):
        text = attempt(site)
        if not text:
            return bool(trail)
        trail.append(f"read: {text}")
        done = obey(site, text)
        trail += done
        if not done:
            break
    if strict:
        words = " | ".join(trail[-_SHOWN:])
        site.problem(f"a person cannot leave this state by what the messages say: {words}")
    return False


def attempt(site: Site) -> str:
    """Send a short motion; return nothing if it succeeds, else all that a person can read."""
    goal_id = site.send(21)
    if goal_id:
        answer = site.result(goal_id)
        if answer.get("success"):
            return ""
        cause = answer.get("cause") or answer
    else:
        cause = site.server.get("/api/goals")
    status = site.ended(site.command("status"))
    hint = cause.get("hint", "") if isinstance(cause, dict) else ""
    message = cause.get("message", "") if isinstance(cause, dict) else ""
    return f"{message} -> {hint} / {' '.join(status.split())}"


def obey(site: Site, text: str) -> list[str]:
    """Do what a text says, in the order of a careful reader; return what was done."""
    done = []
    if _HANDS.search(text):
        site.repair()
        done.append("cable, power")
    commands = [each for each in _COMMAND.findall(text) if each.startswith("arm ")]
    if _BOTH.search(text):
        commands = ["arm configure", "arm activate"]
    elif not commands and (match := _ONE.search(text)):
        commands = [f"arm {match.group().split()[0]}"]
    for words in commands:
        answer = site.ended(site.command(*words.split()))
        done.append(f"armtree {words}: {' '.join(answer.split())}")
        if _HANDS.search(answer):
            site.repair()
            done.append("cable, power")
    if not done and _WAIT.search(text):
        site.ended(site.command("cancel"))
        done.append("armtree cancel")
    if not done and _AGAIN.search(text):
        done.append("again")
    return done
