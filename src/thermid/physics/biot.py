"""Is one node enough for a part? The Biot number and its warning."""

from __future__ import annotations

import warnings

import numpy as np

from thermid.errors import ThermidWarning
from thermid.physics._number import Number

BIOT_LIMIT = 0.1
"""Above it the temperature inside a part is not uniform; Incropera, 6th ed., Section 5.2. [-]"""


def biot_warning(biot: float, name: str = "this part") -> str:
    """Sentence for a Biot number above the limit, or an empty text.

    Parameters
    ----------
    biot : float   Biot number. [-]
    name : str     Part that the sentence names.

    References
    ----------
    Incropera, 6th ed., Section 5.2.

    Examples
    --------
    >>> biot_warning(0.4, "'fog.coil'")
    "The Biot number of 'fog.coil' is 0.4, above 0.1: its inside is not at one temperature. Split it into more nodes."
    >>> biot_warning(0.0019)
    ''
    """
    if not biot > BIOT_LIMIT:
        return ""
    return f"The Biot number of {name} is {biot:.2g}, above {BIOT_LIMIT:g}: its inside is not at one temperature. Split it into more nodes."


def biot_number(htc: Number, length: Number, conductivity: Number) -> Number:
    """Biot number h L / k [-].

    Parameters
    ----------
    htc : float or array            Coefficient at the surface. [W/(m^2 K)]
    length : float or array         Path of the heat inside: half a wall, or volume over area. [m]
    conductivity : float or array   Conductivity of the part. [W/(m K)]

    Warns
    -----
    ThermidWarning   Above 0.1.

    References
    ----------
    Incropera, 6th ed., Section 5.2. (The source document prints h L K^-1; the divisor is the conductivity.)

    Examples
    --------
    The aluminium case of the EleGFO box of the source document at its theoretical coefficient:

    >>> round(biot_number(6.798, 0.02492, 130.0), 4)
    0.0013
    """
    biot = htc * length / conductivity
    text = biot_warning(float(np.max(biot)))
    if text:
        warnings.warn(text, ThermidWarning, stacklevel=2)
    return biot
