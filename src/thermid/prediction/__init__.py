"""The uncertainty room: what a model leaves open in a scenario, by named source, and the questions that are asked of it."""
