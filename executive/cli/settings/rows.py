"""The settings: one row for each option, environment variable and key of `armtree.toml`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.api import PORT, Policy
from executive.setup import Setup, find_own_trees
from hardware.loading.dataclass import dataclass

from .value_types import ABOVE_0, AT_LEAST_0, PATH, Finite, FleetUrl, Url, Whole

if TYPE_CHECKING:
    from hardware.toml_table import TomlTable

_LARGEST = 2**31 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A setting.

    Attributes:
        type: Type of the value.
        help: Meaning of the setting, for `--help`.
        default: Default value, or a function that returns it; None for no default.
        metavar: Word for the value in `--help`; None for the name of the type.
    """

    type: "click.ParamType[Any]"
    help: str
    default: Any = None
    metavar: str | None = None

    def read(self, table: "TomlTable", key: str, folder: Path) -> Any:
        """Return the value of a key of a file. A relative path is in the folder of the file.

        Raises:
            DescriptionError: The value is wrong.
        """
        kind = self.type
        if isinstance(kind, click.IntRange):
            most = _LARGEST if kind.max is None else int(kind.max)
            return table.integer(key, range(int(kind.min or 0), most + 1))
        given = table.number(key) if isinstance(kind, click.FloatRange) else table.text(key)
        if isinstance(kind, click.Path):
            from hardware import shipped_robots

            if key == "robot" and str(given) in shipped_robots():
                return Path(str(given))
            return folder / Path(str(given)).expanduser()
        try:
            return kind.convert(given, None, None)
        except click.BadParameter as error:
            table.fail(key, error.message)


SETTINGS = {
    "port": Setting(
        metavar="PORT",
        type=click.STRING,
        help="Serial port, or `virtual` for a simulated board. Default: that of the robot file.",
    ),
    "robot": Setting(
        metavar="FILE",
        type=PATH,
        help="Robot file, or a name that `armtree robots` lists. Default: arduinobot.",
    ),
    "trees": Setting(
        metavar="FOLDER",
        type=PATH,
        default=find_own_trees,
        help="Folder with your own task files. Default: ./trees, if it exists.",
    ),
    "skills": Setting(
        metavar="FOLDER", type=PATH, help="Folder with your own skills: Python files."
    ),
    "world": Setting(
        metavar="FILE",
        type=PATH,
        help="JSON or YAML file with the bodies around the arm; see *Plan and explain*.",
    ),
    "recordings": Setting(
        metavar="FOLDER", type=PATH, default=Setup.recordings, help="Folder for recordings."
    ),
    "server": Setting(
        type=Url(),
        metavar="URL",
        help="URL of the server. Default: the one on this machine.",
    ),
    "fleet": Setting(
        type=FleetUrl(), metavar="URL", help="URL of the NATS server of a fleet of arms."
    ),
    "tcp_port": Setting(
        metavar="PORT",
        type=Whole(0, 65535),
        default=PORT,
        help="TCP port of the server; 0 for any free one.",
    ),
    "policy": Setting(
        type=click.Choice([policy.value for policy in Policy]),
        default=Setup.policy.value,
        help="What happens to a goal while another one runs.",
    ),
    "result_timeout": Setting(
        type=Finite(-1),
        default=Setup.result_timeout,
        metavar="SECONDS",
        help="How long a result is kept [s]; -1 to keep it until there are 1000 newer results.",
    ),
    "seed": Setting(metavar="N", type=Whole(1), default=Setup.seed, help="Seed of the planner."),
    "workers": Setting(
        metavar="N", type=Whole(1), default=Setup.workers, help="Number of planner processes."
    ),
    "planning_timeout": Setting(
        type=Finite(0.1, 3600.0),
        default=Setup.planning_timeout,
        metavar="SECONDS",
        help="Longest time to plan a motion, without the time to read meshes [s].",
    ),
    "recording_timeout": Setting(
        type=ABOVE_0,
        default=Setup.recording_timeout,
        metavar="SECONDS",
        help="Longest time that a frame may wait for the recording of the previous frame [s]. "
        "After that time the motion ends with log.behind. While a frame waits, the arm stands "
        "still in the middle of its motion; a shorter time ends more motions on a slow disk.",
    ),
    "keep_days": Setting(
        metavar="DAYS", type=AT_LEAST_0, help="Delete recordings older than this [days]."
    ),
    "keep_mb": Setting(
        metavar="MB",
        type=AT_LEAST_0,
        help="Delete the oldest recordings, so that all have at most this size together [MB].",
    ),
}


def environment_name(name: str) -> str:
    """Return the environment variable of a setting."""
    return f"ARMTREE_{name.upper()}"
