"""The settings: their rows, the files that hold them, and the options of commands."""

from .armtree_toml import (
    FILE as FILE,
    configured as configured,
    files as files,
    read_files as read_files,
    user_file as user_file,
)
from .option import (
    SETTINGS_SECTION as SETTINGS_SECTION,
    F as F,
    find_setting as find_setting,
    given_options as given_options,
    option as option,
)
from .rows import SETTINGS as SETTINGS, environment_name as environment_name
from .value_types import (
    ABOVE_0 as ABOVE_0,
    AT_LEAST_0 as AT_LEAST_0,
    PATH as PATH,
    Finite as Finite,
    FleetUrl as FleetUrl,
    Url as Url,
    Whole as Whole,
)
