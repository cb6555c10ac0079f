"""Lumped-parameter thermal models: build, fit, predict."""
