"""Values and states where the model itself is driven by noise.

In: a model, records, what is free, and the noise that drives nodes, loads or boundaries. Out: an `Estimation`: values by maximum likelihood
of a Kalman filter beside those of output error, chosen by left-out open-loop prediction; filtered and smoothed states with bands.
"""
