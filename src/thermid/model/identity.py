"""Which values of several places are one, and what a replaced part keeps."""

from thermid.model._tree.identity import (
    Identity as Identity,
    cuts_of as cuts_of,
    definition_of as definition_of,
    identity_of as identity_of,
    inside as inside,
    instances as instances,
    local_identities as local_identities,
    made_to as made_to,
    outside as outside,
)
from thermid.model._tree.replacement import (
    Dropped as Dropped,
    PlaceStart as PlaceStart,
    Replacement as Replacement,
    short_text as short_text,
    touching as touching,
    without_layers as without_layers,
)
