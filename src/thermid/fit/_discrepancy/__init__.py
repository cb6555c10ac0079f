"""How far coefficients may depart from their values: within the structure, and from one kind of run to another."""
