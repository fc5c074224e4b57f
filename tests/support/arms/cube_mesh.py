"""A cube, a tray or a room: nested cubes as one mesh of triangles."""

from itertools import product
from pathlib import Path

import numpy as np

from skills.motion import Mesh

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
_TOP = 2  # triangles of the last face, which is that of z = 1

TRIANGLES = [(a, *pair) for a, b, c, d in _FACES for pair in ((b, c), (c, d))]


def cube(folder: Path, sizes: tuple[float, ...], open_top: bool = False) -> Mesh:
    """Nested cubes as an STL: every triangle with its own vertices.

    Sizes are half the edges [m]; those below 0 face inward.
    """
    lines = ["solid"]
    for size in sizes:
        for triangle in TRIANGLES[: -_TOP if open_top else None]:
            corners = "\n".join("vertex {} {} {}".format(*(size * CORNERS[i])) for i in triangle)
            lines.append(f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet")
    file = folder / "cube.stl"
    file.write_text("\n".join([*lines, "endsolid\n"]))
    return Mesh(str(file))
