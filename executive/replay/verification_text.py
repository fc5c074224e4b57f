"""A proof, told to people and to programs."""

import json
from dataclasses import asdict

from .verification import Verification


def in_words(proof: Verification) -> str:
    """Lines for people."""
    lines = [str(proof.path)]
    for verdict in proof.verdicts:
        lines.append(f"  {verdict.question:<16}{'holds' if verdict.holds else 'DIFFERS':<9}")
        lines[-1] += verdict.words
        if verdict.source:
            lines.append(f"{'':<18}comes from {verdict.source}")
    if proof.error:
        lines.append(f"  {proof.error.removeprefix(f'{proof.path}: ')}")
    return "\n".join(lines)


def in_json(proof: Verification) -> str:
    """One object."""
    return json.dumps({**asdict(proof), "path": str(proof.path), "holds": proof.holds})
