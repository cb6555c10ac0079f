// What is seen of a step: dense output, stored values or least squares, turning points.
//
//   T(t + x h) = sum_m poly_m x^m + sum_k ((b + s db) w + c ww + aab www)_k,   s = x h
// The first sum is the quintic through values, first and second derivatives at both ends (a cubic for stiff nodes); the second is the known
// response to what the projection of each sampled input left out (Noise in step.hpp). Sensitivities have the same form. Every output is a short
// row of weights (`shares`) times what the step knows of a node (`terms`), so that many outputs are one matrix product. Slaved nodes are solved
// for at each output instead.
//
//   view       evaluation at an output time
//   poly       (6, n) [K]
//   cursor     of each sampled input, how far its integrals have been taken; at: up to which s
//   lag        heat that fast nodes still take up [W]; lag_s: d/dp of that
//   jumped     an input jumps at the output under way; before: all temperatures there, before the jump
//   shares     (terms, CHUNK); terms: (terms, nodes); slope_terms: (terms, nodes x np); count, slope_count: how many terms
//   idle_shares w and ww of each idle input (idle, 2, CHUNK)
//   SO         sensitivities of all nodes at an output (n, np)
#pragma once
#include <vector>

#include "step/stages.hpp"

namespace thermid {

struct OutputList { const double* t; long n, next; const int* obs; int nobs; };

class Outputs {
  public:
    Evaluation view;
    Turnings turnings;
    bool need_u = false;  // outputs or guards need the inputs' own values
    Outputs(Setup& setup, State& state, Step& step, Slaved& slaved, Errors& errors, Stages& stages);
    void begin();
    void dense_start();
    void dense(bool inside);
    double apart();
    void shorten(double s);
    void nodes_at(double s, bool slaved) { nodes_at(s, s == step_.h ? step_.end : state_.t + s, slaved); }
    void nodes_at(double s, double time, bool slaved);
    void emit(OutputList& out, Result& r);
    void turnings_start();
    void turnings_end(const OutputList& out);

  private:
    Setup& setup_;
    State& state_;
    Step& step_;
    Slaved& slaved_;
    Errors& errors_;
    Stages& stages_;
    const Problem& p_;
    const double* coef_;
    const CoefJacobian& d_;
    const Options& o_;
    LeastSquares* squares_;
    const int n_, np_, nk_;
    std::vector<double> poly_, lag_, lag_s_, before_, shares_, terms_, slope_terms_, SO_, g_, dir_, bb_, dirS_, unit_, idle_shares_;
    std::vector<Cursor> cursor_;
    double at_ = 0.0;
    bool jumped_ = false;
    int count_ = 0, slope_count_ = 0;

    // dense.cpp
    void idle_start();
    std::vector<char> unseen_;  // inputs whose own values no output needs: idle ones that bring heat to nodes with a delay alone
    void move_cursors(double s, double time);
    bool side(double time, bool before);
    double smooth(int i, double x) const;
    double slope(int i, double x) const;
    void slope_sensitivity(int stage, const std::vector<double>& slope, std::vector<double>& out);
    // Second derivatives serve the dense output; of a stiff node they would only amplify its error.
    bool gentle(int i) const { return setup_.cap[i] > -0.1 * step_.h * slaved_.own_rate(i); }

    // outputs.cpp
    void weigh(const double* times, int m);
    void temperature_terms(const int* obs, int nobs);
    void sensitivity_terms(const int* obs, int nobs);
    void add_idle(double* S, int m, const int* obs, int nobs) const;
    bool delayed(const int* obs, int nobs) const;
    void rows(const double* times, long m, const int* obs, int nobs, double* T, double* S);
    void slaved_row(double s, double time, const int* obs, int nobs, double* S);
    void collect(const double* times, long last);

    // outputs_turnings.cpp
    std::vector<double> seen_times_, seen_both_, seen_values_;
    std::vector<double> start_t_;  // all temperatures at the step's start, with the inputs of this step
    struct SumPart { int place, input; double weight; };  // weight times the followed node there, or times an input (-1: one)
    struct Unrest { double rate = 0.0, moved = 0.0, direct = 0.0; bool jumps = false; };  // K/s, K, K
    std::vector<int> followed_;
    std::vector<std::vector<SumPart>> sum_parts_;
    bool polynomial_ = true;  // no boundary of a sum is a wave
    void turnings_of(int column, int node) { turnings.see_polynomial(column, poly_.data() + node, n_, state_.t, step_.h, step_.end, step_.T1[node]); }
    bool quiet(int node) const;
    void follow(const OutputList& out);
    Unrest unrest() const;
    void turnings_smooth(const OutputList& out);
    void turnings_knots(const OutputList& out, double gap);
    void turnings_sampled(const OutputList& out);
};

}  // namespace thermid
