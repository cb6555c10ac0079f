"""What a model predicts, with its uncertainty by named source.

In: a fit, a values file or stated spreads, and a scenario. Out: a `Prediction`: temperatures with a band, its sources, and what is not
counted; coefficients separated into radiation and convection; many runs with drawn inputs; hold times; the test to make next; reduced
models.
May import: `base`, `fit`, `inference`, `measure`, `model`, `physics`, `simulation`, `values`.
"""
