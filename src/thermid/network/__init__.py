"""The equations: a model compiled to rows with numbers, massless nodes eliminated, matrices and modes."""
