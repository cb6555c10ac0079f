// What a step errs by, how much is allowed, and the part that is taken out.
//
//   (C - h gamma J) err = h sum_s (b_s - b^_s) F_s     estimate: the step less its embedded solution, filtered as usual for stiff systems
//   (C - h gamma J) E = h sum_s (b_s - b^_s) FS_s      the same for sensitivities, relative to the largest effect of each parameter so far
//   M = (C - h gamma J)^-1 C                            powers of M turn the estimate into the error after a jump (SHED in tableau.hpp)
//
//   shed       the estimate filtered once and twice more by M
//   reach      the largest |S| of each parameter at the end; peak: the largest |E|
//   bend       mean square of an input's left-over times the laws' curvature (n) [W]
//   G          derivatives of an estimate (n, np)
#pragma once
#include <vector>

#include "step/slaved.hpp"

namespace thermid {

class Errors {
  public:
    Errors(Setup& setup, State& state, Step& step, Slaved& slaved);
    double tolerance() const;
    double slope_tolerance() const;
    double error();
    double input_error();
    double unsettled();
    bool clear_of_knees(double& next);
    void improve();
    bool closes() const { return setup_.holds.empty() && !(setup_.constant && step_.factors.exact()); }
    void close_balance(double factored);

  private:
    Setup& setup_;
    State& state_;
    Step& step_;
    Slaved& slaved_;
    const Problem& p_;
    const double* coef_;
    const Options& o_;
    const int n_, np_, nk_;
    std::vector<double> shed_[2], felt_, reach_, peak_, bend_, G_, dir_, bb_;
    std::vector<char> counts_;
    double felt(int from, int to);
    double sensitivity_error();
    void filter_sensitivity(const double* e, double* G);
    double curvature();
};

}  // namespace thermid
