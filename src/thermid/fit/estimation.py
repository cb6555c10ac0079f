"""Fits and states with process noise."""

from thermid.fit._estimation.dynamics import At as At, Dynamics as Dynamics
from thermid.fit._estimation.estimate import estimate as estimate, estimated as estimated
from thermid.fit._estimation.estimation import Estimation as Estimation
from thermid.fit._estimation.filtering import Belief as Belief
from thermid.fit._estimation.passing import Passing as Passing
from thermid.fit._estimation.process import WIENER as WIENER, ProcessNoise as ProcessNoise
