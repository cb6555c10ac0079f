"""Identifiability, profile likelihood, parameter trade-offs and posterior samples."""

from thermid.inference._identifiability import (
    Identifiability as Identifiability,
    Profile as Profile,
    identifiability as identifiability,
    profile as profile,
)
from thermid.inference._posterior import Posterior as Posterior, posterior as posterior
