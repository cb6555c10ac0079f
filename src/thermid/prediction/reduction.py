"""Reduced models with fewer masses; a unit on its host."""

from thermid.prediction._reduction.macro import assumed as assumed, macro_model as macro_model
from thermid.prediction._reduction.reduce import Reduction as Reduction, reduce as reduce
