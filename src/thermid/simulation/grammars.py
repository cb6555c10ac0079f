"""Tables of scenario files that other files have too: apart, because what checks grammars loads slowly."""

from thermid.simulation._scenarios.schema import GasTable as GasTable
