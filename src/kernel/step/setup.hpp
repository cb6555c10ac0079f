// What stays the same for a whole run: the network, its parameters, and what follows from them alone.
//
//   C_i dT_i/dt = f_i(T, u(t), p)     nodes with a capacity [W]
//             0 = f_i(T, u(t), p)     massless ones
//
//   p          the parameters to which sensitivities S = dT/dp are wanted, np of them
//   u          the inputs, nk of them: constant, sine, or sampled
//   cap        C, zero for massless nodes (n) [J/K]; inv_cap: 1 / C, zero for these; cap_at: C by places of the Jacobian's pattern
//   parameters where p enters f; sought: nodes whose C depends on p
//   con_u, load_u      where inputs that move enter conductors and loads
//   pushes, other_u    the conductors' once more: those by a boundary, ready to add to df/du, and the others
//   idle       inputs that move no temperature, since all their coefficients are zero, and the parameters that would let them; idles: whether an
//              input is one; acting: the others that move
//   holds      (massless node, node that holds its heat)
//   faint      of each parameter, one over its size: its effect is let be below a part of that
//   curved     some law is not linear in temperature
//   constant   the Jacobian is: no law is curved, no conductance follows an input
#pragma once
#include <utility>
#include <vector>

#include "step/run.hpp"
#include "leastsquares/leastsquares.hpp"

namespace thermid {

// A sampled input that moves nothing, and one parameter of its coefficients: of dT/dp it moves that column alone.
struct IdleInput {
    struct Part { Entry entry; bool load; double factor; };
    int input, name;
    std::vector<Part> parts;
};

struct Setup {
    const Problem& p;
    const double* coef;
    const CoefJacobian& d;
    const Options& o;
    LeastSquares* squares;  // outputs go there, where there is one, and nothing is stored
    const int n, np, nk;
    Scatter parameters;
    std::vector<Entry> con_u, load_u, other_u;
    std::vector<Push> pushes;
    std::vector<int> sought, all;  // all: every node
    std::vector<double> cap, inv_cap, cap_at, faint;
    std::vector<std::pair<int, int>> holds;
    std::vector<IdleInput> idle;  // in the order of inputs
    std::vector<char> idles;
    std::vector<int> acting;
    bool curved = false, constant = false;

    Setup(const Problem& problem, const double* coefficients, const CoefJacobian& derivatives, const Options& options, LeastSquares* readings);
    void take_capacities();
    void capacity_term(double* y, const double* v, double scale) const;

  private:
    void find_entries();
    void find_idle();
};

}  // namespace thermid
