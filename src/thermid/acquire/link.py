"""What is said to the board: settings, heater duties, signs of life; said again until it is answered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thermid.acquire.programme import Programme
from thermid.acquire.wire import sealed

if TYPE_CHECKING:
    from thermid.acquire.settings import Settings

_PATIENCE = 1.0
_TRIES = 5


class Link:
    """Commands on their way.

    Parameters
    ----------
    settings : Settings   What a board is told when it begins.
    clears : bool         Whether heaters that were cut off are allowed again at the start.
    """

    def __init__(self, settings: Settings, clears: bool = False) -> None:
        self._settings = settings
        self._next = 1
        self._open: dict[int, tuple[str, float, int]] = {}
        self._duties: tuple[int, int] | None = None
        self._alive = -1e9
        self.failed: list[str] = []
        self._clears = clears

    def connected(self) -> None:
        """Begin again with a board that knows nothing."""
        own = [*self._settings.commands(), "identify"]
        if self._clears:
            own.insert(0, "clear")  # somebody has asked for it at this start; a cable that comes back clears nothing
            self._clears = False
        asked = [command for command, _, tries in self._open.values() if not tries and command not in own and "heater," not in command]
        self._open.clear()
        self._duties = None
        for command in [*own, *asked]:
            self.add(command)

    def add(self, command: str) -> None:
        """Put a command in line."""
        self._open[self._next] = (command, -1e9, 0)
        self._next += 1

    @property
    def idle(self) -> bool:
        """Whether every command is answered."""
        return not self._open

    def due(self, now: float, seconds: float, programme: Programme | None) -> list[str]:
        """Return the lines to send: new commands, those that nobody answered, a sign of life."""
        if programme is not None and (duties := programme.at(seconds)) != self._duties:
            before = self._duties or (-1, -1)
            for k, duty in enumerate(duties):
                if duty != before[k]:
                    self._drop(f"heater,{k + 1},")
                    self.add(f"heater,{k + 1},{duty}")
            self._duties = duties
        out = []
        for number, (command, sent, tries) in list(self._open.items()):
            if now - sent < _PATIENCE:
                continue
            if tries >= _TRIES:
                self.failed.append(command)
                del self._open[number]
                continue
            self._open[number] = (command, now, tries + 1)
            out.append(sealed(f"{number},{command}"))
        if out:
            self._alive = now
        elif now - self._alive >= self._settings.silence / 4.0:
            self._alive = now
            out.append(sealed("0,alive"))
        return out

    def off(self) -> list[str]:
        """Return the lines that turn both heaters off."""
        self._open.clear()
        if not self._duties or not any(self._duties):
            return []
        self._duties = (0, 0)
        numbers = range(self._next, self._next + 2)
        self._next += 2
        for k, number in enumerate(numbers, 1):
            self._open[number] = (f"heater,{k},0", 1e9, 1)
        return [sealed(f"{number},{self._open[number][0]}") for number in numbers]

    def answered(self, fields: tuple[str, ...]) -> str:
        """Take in an answer; return what was refused and why, or an empty text."""
        number, word = fields
        known = self._open.pop(int(number), None) if number.isdigit() else None
        return f"{known[0]}: {word}" if known is not None and word != "ok" else ""

    def _drop(self, beginning: str) -> None:
        """Forget commands that a newer one replaces."""
        self._open = {n: each for n, each in self._open.items() if not each[0].startswith(beginning)}
