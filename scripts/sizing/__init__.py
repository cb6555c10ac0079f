"""Sizes of model error from public test sets: the sets, their likelihoods, the population over sets, and its judgement by whole sets."""
