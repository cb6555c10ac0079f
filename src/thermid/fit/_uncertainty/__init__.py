"""What fitted values are worth: information, autocorrelated residuals, inherited errors, contradictions.

In: a `Problem` and its minimum. Out: groups of unknowns that act together, the noise that residuals are, responses of values to named
sources of error, and whether the readings contradict what was known before.
"""
