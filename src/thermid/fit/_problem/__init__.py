"""What a fit compares: readings of logs and readings of a model, as residuals over the unknowns.

In: a `Request`: a model, records, what is free and what is known before. Out: a `Problem`: weighted residuals of all records with
exact derivatives from the kernel, unknowns with transforms, bounds and priors, and the key of all that the result depends on.
"""
