"""`Standing`: how far values, and whatever rests on them, may be trusted."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

State = Literal["credible", "unjudged", "not adequate", "not credible", "failed"]
ORDER: tuple[State, ...] = get_args(State)
"""From best to worst."""
FAIR = 2
"""How many of them nobody needs to be told of."""
UNUSABLE, INADEQUATE = 1, 5
"""Exit codes of an answer that rests on values which are not credible or failed, and on values which are not adequate."""


@dataclass(frozen=True)
class Standing:
    """How far a value or a result may be trusted, and why.

    Parameters
    ----------
    state : str     credible (a fit that its data support), unjudged (a deck's or hand-tuned value), not adequate (the model misses more
                    than its stage allows), not credible (contradicts what was stated, or did not converge), or failed (a verdict failed).
    because : str   The reason in words; empty for credible and unjudged.
    stage : str     The stage that the reason is about; empty for none.
    accepted : bool Whether that stage was accepted as it is: the state stays, the exit code does not count it.
    beside : tuple  Standings of further stages that the result rests on and that are not fair either.
    """

    state: State
    because: str = ""
    stage: str = ""
    accepted: bool = False
    beside: tuple[Standing, ...] = ()

    @property
    def rank(self) -> int:
        """Position from best (0, credible) to worst."""
        return ORDER.index(self.state)

    @property
    def fair(self) -> bool:
        """Whether there is nothing to be told: credible or unjudged."""
        return self.rank < FAIR

    @property
    def usable(self) -> bool:
        """Whether an answer may rest on it: neither not credible nor failed."""
        return self.rank < ORDER.index("not credible")

    @property
    def judgeable(self) -> bool:
        """Whether hold-out data may be opened for it: nothing that it rests on is not credible, accepted or not."""
        return all(s.state != "not credible" for s in self.causes)

    @property
    def causes(self) -> tuple[Standing, ...]:
        """Every cause that is not fair, the worst one first, each by itself."""
        return tuple(replace(s, beside=()) for s in (self, *self.beside) if not s.fair)

    @property
    def exit_code(self) -> int:
        """Exit code of an answer that rests on it: 0; 1 for not credible or failed; 5 for not adequate. Accepted stages do not count."""
        open_causes = [s for s in self.causes if not s.accepted]
        return 0 if not open_causes else INADEQUATE if all(s.usable for s in open_causes) else UNUSABLE

    def reason(self, of: str = "", link: str = "rests on stage") -> str:
        """Return the reason in words for a result of stage `of`: its own, or that it rests on another stage."""
        return self.because if not self.stage or self.stage == of else f"{link} '{self.stage}' ({self.because})"

    def line(self, of: str = "", link: str = "rests on stage") -> str:
        """Return the line that stands first in a result of stage `of`; empty where there is nothing to be told."""
        return "; also ".join(f"{s.state.upper()}{' (accepted)' * s.accepted}: {s.reason(of, link)}" for s in self.causes)

    def over(self, text: str, link: str = "rests on stage") -> str:
        """Return a result as text below the line that must stand first in it."""
        return f"{self.line(link=link)}\n{text}" if not self.fair else text

    def accept(self, stages: Container[str]) -> Standing:
        """Return it with the causes of some stages accepted."""
        beside = tuple(s.accept(stages) for s in self.beside)
        return replace(self, accepted=self.accepted or (not self.fair and self.stage in stages), beside=beside)

    def kept(self) -> dict[str, Any]:
        """Return it as a file holds it; see `read`."""
        out: dict[str, Any] = {"state": self.state, "because": self.because, "stage": self.stage}
        out |= {"accepted": True} if self.accepted else {}
        return out | ({"beside": [s.kept() for s in self.beside]} if self.beside else {})

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> Standing:
        """Return what `kept` wrote.

        Raises
        ------
        ValueError   When there is no such state.
        """
        if table["state"] not in ORDER:
            raise ValueError(f"there is no standing '{table['state']}'")
        beside = tuple(cls.read(s) for s in table.get("beside", ()))
        return cls(table["state"], str(table["because"]), str(table["stage"]), bool(table.get("accepted", False)), beside)

    def to_dict(self, of: str = "") -> dict[str, Any]:
        """Return it as the JSON of a command holds it, for a result of a stage: the reason is that of its first line."""
        out: dict[str, Any] = {"state": self.state, "because": self.reason(of), "stage": self.stage}
        out |= {"accepted": True} if self.accepted else {}
        return out | ({"beside": [s.to_dict(of) for s in self.causes[1:]]} if self.beside else {})


CREDIBLE = Standing("credible")
UNJUDGED = Standing("unjudged")


def worst(standings: Iterable[Standing]) -> Standing:
    """Return the worst of several standings with the other causes beside it; credible where there is none.

    Of equals the one that is not accepted comes first, then the first one.
    """
    several = list(standings)
    causes = list(dict.fromkeys(c for s in several for c in s.causes))
    if not causes:
        return replace(max(several, key=lambda s: s.rank, default=CREDIBLE), beside=())
    first = max(causes, key=lambda s: (s.rank, not s.accepted))
    taken: dict[tuple[str, str], Standing] = {}
    for s in causes:
        if s is not first and (s.state, s.stage) != (first.state, first.stage):
            taken.setdefault((s.state, s.stage), s)
    return replace(first, beside=tuple(sorted(taken.values(), key=lambda s: -s.rank)))
