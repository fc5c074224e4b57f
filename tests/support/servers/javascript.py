"""Programs of others in JavaScript, for those tests that need them."""

import shutil
import subprocess

from tests.support.paths import PEERS


def without_node(package: str) -> str:
    """Why a package cannot be tried here; empty where it can."""
    if not shutil.which("node"):
        return "node is not installed"
    asked = subprocess.run(["node", "--version"], capture_output=True, text=True, check=True)
    if int(asked.stdout.removeprefix("v").partition(".")[0]) < 20:
        return f"{package} needs node 20, and this is {asked.stdout.strip()}"
    return "" if (PEERS / "node_modules" / package).is_dir() else f"{package} is not installed"
