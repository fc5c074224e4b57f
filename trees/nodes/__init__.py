"""The kinds of control nodes. Each class has all properties of its kind: see `kind.py`."""

from importlib import import_module

from .kind import KINDS

# Messages list the kinds in this order.
for _family in ("composites", "parallel", "loops", "decorators", "guard"):
    import_module(f".{_family}", __name__)

__all__ = ["KINDS"]
