"""Random networks of every kind of trouble, independent solutions of them, and who computes them."""
