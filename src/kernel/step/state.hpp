// Where a run stands: temperatures, their sensitivities, and what has happened so far.
//
//   t          time [s]
//   T          temperatures, and states of controls (n) [K]
//   S          dT/dp (n, np)
//   low, high  range of temperatures so far, boundaries included [K]
//   entered    when each switch came to its state [s]; entered_s: d/dp of that (switches, np)
//   switched   how often each switch has switched; most_switched: the largest of these
//   sampled    of each sampler, how many samples it has taken
//   drift      what the laws' curvature has made of the noise of inputs (n) [K]
//   E_con, E_load      heat through conductors and of loads since the start [J]
// The states of switches themselves are in the evaluation of the step (`Step::e.on`), since laws depend on them.
#pragma once
#include <vector>

#include "step/setup.hpp"

namespace thermid {

struct State {
    double t = 0.0, low = 0.0, high = 0.0;
    std::vector<double> T, S, entered, entered_s, drift, E_con, E_load;
    std::vector<long> sampled, switched;
    long most_switched = 0;
    explicit State(const Setup& setup);
};

}  // namespace thermid
