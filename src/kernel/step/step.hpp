// The step under way, from t to `end` = t + h, by an ESDIRK method of six stages with weights a_sj and nodes c_s (tableau.hpp):
//
//   C (T_s - T) = h sum_j a_sj F_j,   F_s = f(T_s, u(t + c_s h))          stages; T_6 = T1 is the end of the step
//   C S_s = C S + C_p (T - T_s) + h sum_j a_sj FS_j,   FS = dF/dp         their exact derivatives, by the same factors
//
//   e          evaluation where the stages are; its `on` is the state of the switches
//   T1, S1     temperatures and sensitivities at the end
//   F, FS      heats of the stages (6, n) [W], their derivatives (6, n, np)
//   beyond     heats of the stages beyond the tangent at the start (6, n) [W]
//   J0, J1     df/dT at the start and at the end, as values of the pattern [W/K]
//   factors    of C - h gamma J
//   d, dd      dT/dt and its derivative in time, at the start (0) and the end (1); sd, sdd: their derivatives in p
//   in, hint   the inputs' projections over the step, and where in their samples these lie; leftover: some input is more than its projection
//   worst      of each input, the most that is left over of it
//   u0, uder0, uder1   inputs at the start; their slopes at the start and the end
//   fu         df/du (nk, n)
//   noise      what the left-over of each input does to the temperatures within the step
//   idle_b, idle_ab    of each idle input, db/dp and d(ab)/dp of its parameter (idle, n); those of others are in `noise`
//   drift_next drift at the end
//   delta      last change by Newton [K]; err: error estimate of the end [K]
//   acc_con, acc_load  heat through conductors and of loads, over h [W]
//   slack      part of the tolerances that a step may err by
#pragma once
#include <vector>

#include "step/factors.hpp"
#include "step/setup.hpp"
#include "step/tableau.hpp"

namespace thermid {

// Dense-output correction for the left-over v of one input: T += (b + s db) w + c ww + aab www, w = int v ds, ww = int w ds, www = int ww ds.
// With A = C^-1 J and b = C^-1 df/du: ab = A b, aab = A A b, db = db/dt, c = ab - db; sb, sc: derivatives of b and ab in p.
struct Noise {
    bool active = false;
    double w = 0.0, ww = 0.0, www = 0.0;
    std::vector<double> b, ab, aab, db, c, sb, sc;
};

struct Step {
    double h = 0.0, end = 0.0, slack = 1.0;
    Evaluation e;
    std::vector<double> T1, S1, F, FS, beyond, J0, J1, d0, d1, dd0, dd1, sd0, sd1, sdd0, sdd1, delta, err, acc_con, acc_load, drift_next;
    Factors factors;
    std::vector<StepInput> in;
    std::vector<int> hint;
    bool leftover = false;
    std::vector<double> worst, u0, uder0, uder1, fu, idle_b, idle_ab;
    std::vector<Noise> noise;
    long newton = 0;  // iterations so far in the run
    explicit Step(const Setup& setup);
};

}  // namespace thermid
