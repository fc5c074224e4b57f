"""Task files: grammar, reading, compilation and checks, and the shipped tasks."""

import typing

from hardware.loading.lazy_exports import lazy_exports

if typing.TYPE_CHECKING:
    from .declarations import UNITS as UNITS, Declaration as Declaration
    from .errors import (
        EXAMPLES as EXAMPLES,
        FileError as FileError,
        Mistake as Mistake,
        Place as Place,
        TreeError as TreeError,
        UnknownTask as UnknownTask,
    )
    from .reading.document import Located as Located
    from .reading.grammar import TaskFile as TaskFile, parse_value as parse_value
    from .reading.library import Library as Library, TaskLibrary as TaskLibrary
    from .reading.literals import (
        fit as fit,
        in_radians as in_radians,
        in_smaller_units as in_smaller_units,
        is_bare as is_bare,
        near_limit as near_limit,
    )
else:
    __getattr__ = lazy_exports(__name__)
