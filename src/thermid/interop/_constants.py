"""Published numbers of the room: units of decks, the coefficients of an integrator."""

from thermid.base.units import HOUR, ICE_POINT, MINUTE

BTU = 1055.05585262
"""International table British thermal unit. [J]"""
RANKINE = 5.0 / 9.0
"""A degree of Rankine or Fahrenheit. [K]"""
ENERGY = {"J": 1.0, "KJ": 1e3, "BTU": BTU, "CAL": 4.184, "W-HR": HOUR, "W*S": 1.0}
TIME = {"S": 1.0, "SEC": 1.0, "MIN": MINUTE, "HR": HOUR, "H": HOUR}
LENGTH = {"M": 1.0, "MM": 1e-3, "CM": 1e-2, "IN": 0.0254, "FT": 0.3048}
ZERO = {"K": 0.0, "R": 0.0, "C": -ICE_POINT, "F": -459.67}
"""Absolute zero in a unit of temperature."""
STAGES = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
)
COUPLED = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)
TIMES = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
DRIFT = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
GAMMA = 0.25
"""RODAS: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, section IV.7; order 4, stiffly accurate."""
