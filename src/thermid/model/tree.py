"""A model: parts within parts, laid flat, with the values of its parameters and the rules that check it."""

from thermid.model._tree.areas import ledger as ledger
from thermid.model._tree.flat import (
    Flat as Flat,
    FlatConductor as FlatConductor,
    FlatControl as FlatControl,
    FlatLoad as FlatLoad,
    FlatNode as FlatNode,
    FlatSurface as FlatSurface,
    flatten as flatten,
    streams_of as streams_of,
)
from thermid.model._tree.model import Model as Model, identities as identities
from thermid.model._tree.rules import Finding as Finding, unlumped as unlumped
from thermid.model._tree.tree import (
    SET as SET,
    Entry as Entry,
    Names as Names,
    ParameterSet as ParameterSet,
    Submodel as Submodel,
    Tree as Tree,
)
