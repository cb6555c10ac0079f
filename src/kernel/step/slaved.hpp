// Nodes that follow the others without delay: massless ones, and ones far faster than the step. With the free nodes x and the slaved ones z
//
//   0 = f_z(x, z, u) [- heat]           z by Newton, its Jacobian J_zz factored once for as long as it serves
//   J_zz dz = -(g_z + J_zx dx)          a direction of x completed (respond); g: df by the direction of the inputs
//   rate = C^-1 (g + J dir)             d(dT/dt) along a completed direction, zero for z
//   J_zz S_z = heat_p - f_p - J_zx S_x  their sensitivities
//
//   massless   nodes without a capacity
//   fast       solved at outputs: their C / |J_ii| is below 1e-2 of the step, since rounding would show in their dT/dt (1e-8 of the step), or
//              1e-4 where the left-over of an input reaches them undelayed
//   quick      slaved in second derivatives (1e-2: unsettled, they would spoil those of their neighbours)
#pragma once
#include <vector>

#include "step/state.hpp"
#include "step/step.hpp"

namespace thermid {

struct SlavedGroup {
    std::vector<int> nodes, con_rows, load_rows;
    std::vector<char> is;
    std::vector<int> place;  // of a node among them
    std::vector<int> tied;   // fast ones that do not follow: only they and their like determine each other
    Scatter parameters;
    Pattern pattern;         // their block of the Jacobian
    Elimination elimination;
    std::vector<int> from;   // place of each of its entries among all
    SparseLu lu;
    bool factored = false;
};

class Slaved {
  public:
    SlavedGroup massless, fast, quick;
    Slaved(Setup& setup, Step& step);
    void make(SlavedGroup& s, double small);
    void index(SlavedGroup& s);
    double own_rate(int i) const;
    void factor(SlavedGroup& s, const double* j);
    void solve(SlavedGroup& s, Evaluation& e, const double* heat = nullptr);
    void rows(const SlavedGroup& s, Evaluation& e) const;
    void respond(SlavedGroup& s, const double* j, const double* g, double* dir);
    void sensitivity(SlavedGroup& s, Evaluation& e, double* S, const double* heat = nullptr);
    void rate(SlavedGroup& s, const double* j, const double* g, double* dir, double* out);
    void rate_sensitivity(SlavedGroup& s, Evaluation& e, const double* j, const double* dir_t, const double* dir_u, const double* S,
                          double* dirS, const double* rate, double* out);

  private:
    Setup& setup_;
    Step& step_;
    const Problem& p_;
    const CoefJacobian& d_;
    const int n_, np_;
    SecondOrder second_;
    SlavedGroup trial_;
    std::vector<int> group_;
    std::vector<int> massless_begin_, massless_at_;  // of each node: places of J(i, m) and J(m, i) of massless neighbours m, and of J(m, m)
    std::vector<double> xa_, fp_, G_, row_, dJ_;
    void find_neighbours();
    void block_of(SlavedGroup& s) const;
    void jacobian(const SlavedGroup& s, const Evaluation& e, double* j) const;
};

}  // namespace thermid
