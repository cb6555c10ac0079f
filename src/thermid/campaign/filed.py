"""A values file over a model as its decks are now: the one place where commands, plans and questions take values from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from thermid.campaign.hand import hand_values
from thermid.knowledge.graft import graft
from thermid.knowledge.store import Store
from thermid.knowledge.values import FittedValues, load_store, read_values, values_of
from thermid.model.tree.model import Model


@dataclass(frozen=True, eq=False)
class Filed:
    """What a values file says of a model.

    Parameters
    ----------
    model : Model           With the values laid over it; what a [set] above says still wins.
    values : FittedValues   What still applies, by the paths of the part that the file is of.
    lacks : tuple of str    What a file of the old format cannot say.
    gone : tuple of str     Values that are left out, since the decks give them otherwise by now.
    hidden : tuple of str   Values that a [set] hides.
    """

    model: Model
    values: FittedValues
    lacks: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """What a reader must know first."""
        return (*self.lacks, *self.gone, *self.hidden)


def filed(path: Path, model: Model, *, at: str = "", keep: bool = False) -> Filed:
    """Return a model with a values file laid over it, whoever wrote the file.

    Parameters
    ----------
    path : Path     A file of a stage, of the studio, or one written by hand.
    model : Model   As its decks are now.
    at : str        The submodel that the file is of; empty for the model itself.
    keep : bool     Whether to keep states of values that the decks give otherwise by now.

    Raises
    ------
    ThermidError   When it is no values file, or is of another model.
    """
    part = model.submodel(at) if at else model
    by_hand = "schema" not in read_values(path)
    store, stage = (hand_values(path, part, path.name, path.name), path.name) if by_hand else load_store(path)
    lacks = tuple(x.what for x in store.left_out if "(schema 1)" in x.what)
    known = store if keep else store.matching(part)
    gone = tuple(f"{d.path} = {d.text} of {d.origin} is left out: {d.why}." for d in known.dropped[len(store.dropped) :])
    placed: Store = graft(model, [(at, known)])[0] if at else known
    laid = placed.on(model)
    return Filed(laid, values_of(known, stage), lacks, gone, placed.acting_in(laid)[1])
