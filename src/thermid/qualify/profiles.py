"""Test profiles of the standards, and their runs on a model."""

from thermid.qualify._profile_runs.conduct import run_profile as run_profile
from thermid.qualify._profile_runs.profile_run import ProfileRun as ProfileRun
from thermid.qualify._profiles.profile import (
    ThermalProfile as ThermalProfile,
    equivalent_cycles as equivalent_cycles,
    load_profile as load_profile,
    profile_names as profile_names,
    profile_of as profile_of,
    typed as typed,
)
