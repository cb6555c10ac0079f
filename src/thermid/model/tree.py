"""A model: parts within parts, laid flat, with the values of its parameters and the rules that check it.

Its elements, their parameters, and what their laws are made of: signals, curves, stores. Deck files, read and written.
Which values of several places are one, and what a replaced part keeps.
"""

from thermid.model._blocks.block import FACES as FACES, Block as Block, Exchange as Exchange
from thermid.model._deck.document import DeckDocument as DeckDocument, Edit as Edit, Renamed as Renamed
from thermid.model._deck.modelfile import (
    load_model as load_model,
    model_beside as model_beside,
    model_from_dict as model_from_dict,
    model_text as model_text,
    save_model as save_model,
    standard_parts as standard_parts,
    toml_text as toml_text,
)
from thermid.model._laws.law import law as law
from thermid.model._laws.signal import (
    Constant as Constant,
    Drawn as Drawn,
    MeanOf as MeanOf,
    Mixed as Mixed,
    Signal as Signal,
    Sine as Sine,
    TableSignal as TableSignal,
    check_span as check_span,
    common_cycle as common_cycle,
    in_run as in_run,
    joined as joined,
    literal as literal,
    multiplied as multiplied,
    own_signal as own_signal,
    signal as signal,
    together as together,
)
from thermid.model._laws.stores import EXTENSION_REACH as EXTENSION_REACH, Curve as Curve, HeatStore as HeatStore, Melt as Melt
from thermid.model._parts.controls import COMPLEMENT as COMPLEMENT, named_control as named_control
from thermid.model._parts.elements import (
    ACCOMMODATION as ACCOMMODATION,
    CARRIED_BY as CARRIED_BY,
    HINGES as HINGES,
    KINDS as KINDS,
    LOAD_SLOTS as LOAD_SLOTS,
    Conductor as Conductor,
    Facing as Facing,
    HeatLoad as HeatLoad,
    Law as Law,
    MadeIn as MadeIn,
    Node as Node,
    degrees as degrees,
    exposed_area as exposed_area,
)
from thermid.model._parts.parameter import (
    CREDIBLE as CREDIBLE,
    FINISH_CORRELATION as FINISH_CORRELATION,
    UNJUDGED as UNJUDGED,
    Parameter as Parameter,
    Standing as Standing,
    State as State,
    StatedRange as StatedRange,
)
from thermid.model._tree.areas import ledger as ledger
from thermid.model._tree.flat import (
    Flat as Flat,
    FlatConductor as FlatConductor,
    FlatControl as FlatControl,
    FlatLoad as FlatLoad,
    FlatNode as FlatNode,
    FlatSurface as FlatSurface,
    streams_of as streams_of,
)
from thermid.model._tree.identity import (
    Dropped as Dropped,
    Identity as Identity,
    PlaceStart as PlaceStart,
    Replacement as Replacement,
    cuts_of as cuts_of,
    definition_of as definition_of,
    identity_of as identity_of,
    inside as inside,
    local_identities as local_identities,
    outside as outside,
    short_text as short_text,
    touching as touching,
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
