// One run: adaptive ESDIRK4(3) steps in stage values with projected inputs, forward sensitivities, events, dense output.
//
// In ../step:
//   setup.hpp      what stays the same: the equations C dT/dt = f, where parameters and inputs enter
//   state.hpp      where the run stands
//   step.hpp       the step under way and its numbers
//   slaved.hpp     nodes without delay
//   errors.hpp     error estimates, tolerances
//   stages.hpp     Newton in stage values, derivatives of the stages
//   factors.hpp    the iteration matrix
// Here: what is seen of a step (outputs.hpp), the control of the steps (control.cpp), and what changes the state between them: switchings
// (events.cpp) and samples (samples.cpp).
//
// At a switching g(T, t, p) = 0 the instant moves with p, so that S jumps:
//   S+ = S- + (f- - f+) C^-1 dt*/dp,   dt*/dp = -(g_T S + g_p) / (g_T dT/dt + g_t)
#pragma once
#include <limits>
#include <vector>

#include "integrator/outputs.hpp"

namespace thermid {

class Integrator {
  public:
    // With `squares`, outputs go there and nothing is stored.
    Integrator(const Problem& p, const double* coef, const CoefJacobian& d, const Options& o, LeastSquares* squares = nullptr);
    Integrator(const Integrator&) = delete;  // its parts refer to each other
    void run(const double* t0_nodes, const double* s0, double t0, double t_end, const double* out_t, long nout, const int* obs, int nobs,
             Result& r);
    // In parts, for a caller that goes on from time to time: begin where things stand, then go on to later times as often as wanted. Steps may
    // reach beyond such a time, up to `horizon`; what stands there is read off their dense output. Coefficients may change between, told by
    // renew(): what lies beyond is given up. These throw Failure.
    void begin(const double* nodes, double t, const double* entered, Result& r);
    void go_on(double to, double horizon);
    void renew();
    const double* temperatures() const { return (beyond_ ? outputs_.view.t : state_.T).data(); }
    const std::vector<uint8_t>& switches() const { return step_.e.on; }
    const std::vector<double>& entered() const { return state_.entered; }

  private:
    Setup setup_;
    State state_;
    Step step_;
    Slaved slaved_;
    Errors errors_;
    Stages stages_;
    Outputs outputs_;
    const Problem& p_;
    const double* coef_;
    const CoefJacobian& d_;
    const Options& o_;
    const int n_, np_, nk_;
    Result* r_ = nullptr;

    // integrator.cpp
    void initial(const double* s0, OutputList& out);
    void check_state();
    void seen();
    [[noreturn]] void underflow(int cause) const;
    int worst(const std::vector<double>& v) const;

    // control.cpp
    void advance(double t_end, OutputList& out);
    void take(OutputList& out, double& next);
    bool attempt(OutputList& out, double& next);
    bool too_long(double err, double& next);
    double first_step(double span) const;
    double settling();
    double hold_ = std::numeric_limits<double>::infinity();  // step limit by the sampled inputs
    double old_error_ = 1.0, resume_ = 0.0;
    int pending_ = -1, refined_ = 0, same_time_ = 0;
    bool clipped_ = false, first_ = true;
    bool shortened_ = false;  // the step under way ends at a switching that lay within it
    bool inside_ = false;    // outputs fall into this step
    bool in_parts_ = false;  // the next part begins with the step that this one would have made
    bool beyond_ = false;    // the step under way has been made, reaches beyond the time that was asked for, and is not taken yet
    double asked_ = std::numeric_limits<double>::infinity();  // that time
    double wish_ = 0.0;      // the next step, 0 for none

    // events.cpp
    std::vector<double> samples_, when_, rates_;
    std::vector<int> found_;
    bool sensor_slaved_ = false, sensor_boundary_ = false;
    void decide();
    double gap(const Guard& g, double time) const;
    double gap_rate(const Guard& g) const;
    void gap_slope(const Guard& g, double rate);
    double gap_at(int l, double s);
    bool find_event(double& s, int& l);
    void apply_events();
    void apply_event(int l, double rate);
    void pass_edges();

    // samples.cpp
    void begin_samples();
    void sample();
    void put_sample(int k);
};

}  // namespace thermid
