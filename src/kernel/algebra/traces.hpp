// Many rows of outputs at once: weights, which depend on time alone, times terms, which depend on the node alone.
#pragma once
#include "network/inputs.hpp"
#include "algebra/linear.hpp"

namespace thermid {

constexpr int CHUNK = 64;  // outputs at a time; weights are stored (terms, CHUNK)
constexpr int POWERS = 6;  // terms 1, x ... x^5 with x = s / h

// out (rows, m) = w' (rows, k) x (k, padded(m)), where the first weight is 1
void weighted(double* out, const double* w, int rows, const double* x, int k, int m);
void powers(double* w, double* s, const double* times, double t, double end, double h, int rows);  // and s, from t to end = t + h
// From the integrals (3, CHUNK) of an input since the step's start: w and ww; s w and www into `more`.
void left_over(double* w, double* more, const double* s, const double* sums, StepInput in, int rows);

}  // namespace thermid
