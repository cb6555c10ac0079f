// Solutions of (C - h gamma J) x = b, the matrix of Newton's method and of everything that is filtered through it.
//
// It is factored wherever h or J change, as a rule. From KEPT_FROM nodes on factorisations cost more than further solutions: factors are kept then, one
// set for each rung of a ladder of lengths 2^(k/2), with the J that they were made with, and steps are as long as rungs where nothing cuts them. Where
// laws are linear the kept factors are those of M itself; else M is met by refinement
//   x += w M~^-1 (b - M x),   w = 2 / (1 + h / h~)
// with the kept M~, where h~ is its length; w halves what a wrong length does at the stiff end. A rung is made anew where refinement gains less than
// a half each time, or where its further solutions have cost as much as new factors would: so no more than twice the least is ever spent.
//
//   length     h gamma [s]
//   accuracy   of x, relative to its largest entry (of each column)
//   spent      solutions by a rung beyond the first of each system, in columns; price: what factors cost, in the same unit
#pragma once
#include <vector>

#include "algebra/sparse.hpp"
#include "step/setup.hpp"

namespace thermid {

class Factors {
  public:
    explicit Factors(const Setup& setup);
    void take(double length, const double* j);  // throws Failure where no pivot is found
    void solve(double* b, double accuracy);
    void solve_many(double* b, int m, double accuracy);  // b is (n, m), row-major
    long made = 0;
    const bool kept;
    bool exact() const { return all_exact_; }  // every solution since M was taken was by its own factors
    double rung(double h) const;               // the longest step on the ladder that is no longer

  private:
    struct Rung { int exponent = 0; double length = 0.0, spent = 0.0; SparseLu lu; };
    const Setup& setup_;
    const Pattern& pattern_;
    double length_ = 0.0, weight_ = 1.0, price_ = 0.0;
    bool exact_ = true, all_exact_ = true;  // M is what the rung was made of; and was when it was taken
    std::vector<double> a_;  // M, as values of the pattern
    std::vector<Rung> rungs_;
    size_t now_ = 0;         // the rung in use
    std::vector<double> b_, left_, before_, change_, size_;
    std::vector<char> every_;  // node counts
    void make(Rung& r);
    bool refine(double* x, int m, double accuracy);
    void substitute(double* b, int m) const;
};

}  // namespace thermid
