// The stages of one step: Newton in stage values, and the exact derivative of the converged scheme (the equations are in step.hpp).
//
//   r_s = C (T_s - T) - base - h gamma f(T_s),   (C - h gamma J) delta = r_s,   T_s -= delta       until delta is far below the tolerance
//   (C - h gamma J) S_s = CS - C_p (T_s - T) + h sum_(j<s) a_sj FS_j + h gamma f_p
//
//   base       h sum_(j<s) a_sj F_j [J]
//   guess      where the stage would end if every law kept its slopes, but for what earlier stages were beyond these
//   rho        contraction of Newton's method; last_size: its last change [K]
//   CS, comb   C S at the start; the right side of a stage's sensitivities
//   g          df/du du/dt [W/s]
#pragma once
#include <vector>

#include "step/errors.hpp"

namespace thermid {

class Stages {
  public:
    Stages(Setup& setup, State& state, Step& step, Slaved& slaved, Errors& errors);
    void project();
    void set_inputs(double s);
    void start(bool first);
    void start_sensitivity();
    bool solve();
    void heat_sensitivity(const double* j, const double* S, double* fs);

  private:
    Setup& setup_;
    State& state_;
    Step& step_;
    Slaved& slaved_;
    Errors& errors_;
    const Problem& p_;
    const Options& o_;
    const int n_, np_, nk_;
    double rho_ = 0.1, last_size_ = 0.0;
    std::vector<double> CS_, comb_, base_, guess_, g_, xa_;
    void pass_on();
    void guess(int s);
    bool newton(int s);
    void sensitivity(int s);
    void add_energy(int s, bool updated);
};

}  // namespace thermid
