"""A skill cannot end the process of `armtree`; its child processes can end."""

import subprocess
import sys

from tests.support.paths import ROOT

PROGRAM = """
import os
from executive.cli.support.process_end import end_process, forbid_exit
forbid_exit()
try:
    os._exit(0)
except SystemExit as error:
    print(error, flush=True)
if not os.fork():
    os._exit(5)
print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
end_process(7)
"""


def test_only_a_child_process_can_end_at_once() -> None:
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, check=False
    )
    assert run.stdout.decode().splitlines() == [
        "os._exit(0) would end armtree without a result; raise an exception",
        "5",
    ]
    assert run.returncode == 7
