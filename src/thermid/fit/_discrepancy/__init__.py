"""Where coefficients, joints and assumed values were found, and what a further run may have for itself."""
