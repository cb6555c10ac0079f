"""The model of error: one object beside a fit that says how far any answer of its model may be from the truth, and why.

For run r, sensor i at node n, time t (Kennedy and O'Hagan, J. R. Statist. Soc. B 63 (2001) 425, with the errors inside the elements, as
Sargsyan, Huan and Najm, Int. J. Uncertainty Quantification 9 (2019) 365 have them, so that they extrapolate with the physics):

    y = T_n(t; theta + d(x), u + delta) + b + w + e

    theta   values of the deck with their priors; logarithms of positive ones
    d(x)    departures of coefficients, joints, masses and powers: a physical mean, and about it a smooth random function of the
            operating point x, of size s_c, and a constant of each run, of size s_run
    delta   what a room is off by: an Ornstein-Uhlenbeck process through the network
    b, e    constant error and noise of an instrument; w what no element explains, an Ornstein-Uhlenbeck process at a sensor

Runs are straight lines in everything unknown about values that Newton steps find. Sizes are averaged over by their evidence; where a deck
does not say what carries the heat of its surfaces, so are free air and a stream. `sizes.py` has every number that decides.
"""

from thermid.inference._error_model.answers import ErrorBand as ErrorBand, ErrorModel as ErrorModel
from thermid.inference._error_model.sizes import TABLE as SIZES

__all__ = ["SIZES", "ErrorBand", "ErrorModel"]
