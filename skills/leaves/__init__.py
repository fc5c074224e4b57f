"""The shipped skills, one file each."""

from importlib import import_module
from pkgutil import iter_modules

from skills.base import Skill as Skill  # `skills` takes it from here

# A skill registers itself when its class is defined. Messages list skills in this order.
for _file in iter_modules(__path__, f"{__name__}."):
    import_module(_file.name)
