"""Identifiability, profile likelihood, parameter trade-offs and posterior samples."""

from thermid.inference._identifiability import (
    Identifiability as Identifiability,
    identifiability as identifiability,
    identifiability_of as identifiability_of,
)
from thermid.inference._posterior import Posterior as Posterior, posterior as posterior
from thermid.inference._profile import Profile as Profile, profile as profile
