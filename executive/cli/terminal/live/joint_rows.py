"""The joints of an arm as rows of text: position, and a bar between the limits with the target."""

import math
from collections.abc import Mapping, Sequence

from rich.text import Text

from executive.api.events import Where
from hardware.joints import rounded
from hardware.printable import printable

_GAP = 3  # columns between two joints
_NARROWEST, _WIDEST = 8, 32  # columns of a bar
_MEASURED = 10  # columns of a measured position such as -100.0 deg
_AT_REST = 1e-9  # smaller distances to the target count as 0 [rad]


def joint_rows(
    where: Where,
    positions: Mapping[str, float],
    targets: Mapping[str, float],
    width: int,
    most: int,
    measured: Mapping[str, float] | None = None,
) -> list[Text]:
    """Return the rows of the joints of an arm.

    If there are more joints than rows, the joints are in several columns. If they still do not fit,
    moving joints come first, and the last cell has the number of joints that are left out.

    Args:
        where: State of the arm, with its units and limits. A joint without a unit gets no bar.
        positions: Commanded position by joint [rad].
        targets: Position at the end of the motion by joint [rad].
        width: Columns of the terminal.
        most: Largest number of rows, at least 1.
        measured: Measured position by joint [rad]; None or empty if not measured. If given, the
            words `commanded` and `measured` mark the positions.
    """
    if not positions:
        return []
    cells = [
        _Cell(where, name, q, targets.get(name, q), (measured or {}).get(name))
        for name, q in positions.items()
    ]
    name_width = max(len(cell.name) for cell in cells)
    words_width = max(cell.widest for cell in cells)
    least = name_width + words_width + 1
    columns = -(-len(cells) // most)
    fitting = max(1, (width + _GAP) // (least + _GAP))
    if columns > fitting:
        columns, room = fitting, fitting * most - 1
        cells = sorted(cells, key=lambda cell: not cell.moves)
        cells, left_out = cells[:room], len(cells) - room
    else:
        left_out = 0
    bar = (width + _GAP) // columns - _GAP - least - 1
    texts = [cell.text(name_width, words_width, min(bar, _WIDEST)) for cell in cells]
    texts += [Text(f"… {left_out} more", style="dim")] if left_out else []
    return _columns(texts, columns)


class _Cell:
    def __init__(
        self, where: Where, name: str, position: float, target: float, measured: float | None
    ) -> None:
        self.name, self._known = printable(name), name in where.units
        self._position, self._target = position, target
        self._limits, unit = where.limits.get(name), where.units.get(name, "rad")
        ends = (position, target, *(self._limits or ()))
        found = "" if measured is None else f"{rounded(measured, unit):>{_MEASURED}} measured"
        named = found and f" commanded {found}"
        self.words = f"{rounded(position, unit)}{named}"
        self.widest = max(len(rounded(q, unit)) for q in ends) + len(named)

    @property
    def moves(self) -> bool:
        return abs(self._target - self._position) > _AT_REST

    def text(self, name_width: int, words_width: int, bar: int) -> Text:
        """Return name, position and bar, each in its width."""
        words = f"{self.name:<{name_width}} {self.words:>{words_width}}"
        text = Text(words, style="" if self.moves else "dim")
        if bar >= _NARROWEST and self._known:
            text.append(" ").append(self._bar(bar - 2))
        return text

    def _bar(self, width: int) -> Text:
        track = ["─"] * width
        track[self._place(self._target, width)] = "○"
        at = self._place(self._position, width)
        text = Text.assemble(
            ("├" + "".join(track[:at]), "dim"), ("●", "cyan" if self.moves else "")
        )
        return text.append("".join(track[at + 1 :]) + "┤", style="dim")

    def _place(self, position: float, width: int) -> int:
        lower, upper = self._limits or (-math.pi, math.pi)
        if self._limits is None:
            position = math.remainder(position, 2 * math.pi)
        share = (position - lower) / (upper - lower) if upper > lower else 0.5
        return min(width - 1, max(0, round(share * (width - 1))))


def _columns(texts: Sequence[Text], columns: int) -> list[Text]:
    """Return rows of texts, with this number of texts in each row."""
    width = max(text.cell_len for text in texts)
    rows = []
    for start in range(0, len(texts), columns):
        row = Text(no_wrap=True, overflow="ellipsis")
        for text in texts[start : start + columns]:
            row.append(text)
            row.pad_right(width - text.cell_len + _GAP)
        row.rstrip()
        rows.append(row)
    return rows
