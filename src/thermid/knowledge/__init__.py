"""What is known of the values of a model: their state, their uncertainty by named source, and how far they may be trusted."""
