"""Functional mock-up units: a model in a scenario as a file that other simulation tools run; parameters of anybody's FMU fitted.

In: a model and a scenario. Out: an FMU of FMI 2.0 or 3.0, for model exchange and co-simulation, made without a compiler: the library beside
the kernel runs it, and the model is data. Readings and an FMU in, values with
errors out: `fitted`.
"""
