"""Constants of nature and of convention, as they are published."""

from __future__ import annotations

STEFAN_BOLTZMANN = 5.670374419e-8
"""CODATA 2018. [W/(m^2 K^4)]"""

STANDARD_GRAVITY = 9.80665
"""Third General Conference on Weights and Measures, 1901. [m/s^2]"""

ATMOSPHERE = 101325.0
"""Tenth General Conference on Weights and Measures, 1954. [Pa]"""

AMBIENT_DEFAULT = 293.15
"""At which a property is quoted that depends on temperature, where nothing says at which: 20 degC. [K]"""

DEVIATION_OF_MEDIAN = 1.4826
"""Standard deviation of normal samples over the median of their absolute values (Hampel, J. Am. Stat. Assoc. 69 (1974) 383-393). [-]"""
