"""Powers that nobody measured: the history of a load from the temperatures that it made.

In: a model, a record, the load that is unknown. Out: a `PowerHistory` with its uncertainty and its resolution in time, and laws of
power over temperature that fit it, to be fed back into the model.
"""
