// What a run is asked for, and what comes of it.
#pragma once
#include <functional>
#include <limits>
#include <vector>

#include "integrator/turnings.hpp"
#include "network/problem.hpp"

namespace thermid {

enum Status { OK = 0, MAX_STEPS, STEP_UNDERFLOW, NEWTON_FAILED, NON_FINITE, RUN_AWAY, SINGULAR_NODE, BAD_INPUT, CHATTER, TOO_HOT };

struct Options {
    double rtol = 2e-8, atol = 2e-7, input_atol = 1e-4, max_step = std::numeric_limits<double>::infinity();
    long max_steps = 1000000;
    bool energy = true;
    std::vector<double> breaks;
    std::vector<double> mesh;           // ends of steps to take as they are, while their error is not far beyond the tolerances
    std::vector<int> on;                // switches at the start: the state, of thermostats 1 on and 0 off; -1 decided by the sensor
    bool turnings = false;              // of the observed nodes, then of these sums
    Sums sums;
    std::function<void()> poll;         // called now and then; may throw
};

struct Event { double time; int load, on, before; };  // of a thermostat or machine, and its states

struct Result {
    int status = OK, node = -1;
    double time = 0.0;
    double *traces = nullptr, *sens = nullptr;  // (outputs, observed), (outputs, observed, parameters)
    std::vector<double> final_t, final_s;
    std::vector<int> on;
    std::vector<Event> events;
    std::vector<double> load_energy, boundary_energy, conductor_energy;  // J
    std::vector<double> mesh;  // ends of the steps taken
    std::vector<Turnings::Point> turnings;  // columns: observed, then sums
    long steps = 0, rejected = 0, newton = 0, factorisations = 0, filled = 0;
};

struct Failure { int status, node; };

// What a temperature beyond every range says: a massless node has not risen there, it rests there.
inline Failure beyond(const Problem& p, int node, double t) {
    return {p.capacity[node] < 0 && !p.is_state(node) && t > 0.0 ? TOO_HOT : RUN_AWAY, node};
}

}  // namespace thermid
