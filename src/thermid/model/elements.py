"""Elements of a network: nodes, conductors, loads, controls, enclosures, and the kinds of conductor."""

from thermid.model._parts.controls import COMPLEMENT as COMPLEMENT, named_control as named_control
from thermid.model._parts.elements import (
    LOAD_SLOTS as LOAD_SLOTS,
    Conductor as Conductor,
    HeatLoad as HeatLoad,
    MadeIn as MadeIn,
    Node as Node,
)
from thermid.model._parts.facing import Facing as Facing, degrees as degrees
from thermid.model._parts.kinds import (
    ACCOMMODATION as ACCOMMODATION,
    CARRIED_BY as CARRIED_BY,
    HINGES as HINGES,
    KINDS as KINDS,
    Law as Law,
)
from thermid.model._parts.takes import exposed_area as exposed_area
