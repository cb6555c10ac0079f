// Inputs that follow temperatures: what a control gives multiplies coefficients as any other input does, so that loads, conductors, surfaces and
// boundaries are driven by one mechanism. Its slopes join the Jacobian, and what its own coefficients do joins the derivatives.
#pragma once
#include "network/problem.hpp"

namespace thermid {

template <class F>
inline void Evaluation::factor_slope(int k, F add) const {
    const Factor& x = p->factors[k];
    auto put = [&](int c, double by) {
        if (c < p->nc && by != 0.0) add(c, by * (p->coef_input[c] < 0 ? 1.0 : u[p->coef_input[c]]));
    };
    if (x.kind == OF_STATE) {
        const size_t state = on[p->control.size() + x.machine];
        return put(x.values[state < x.values.size() ? state : x.values.size() - 1], 1.0);
    }
    const double by = bend[k];
    if (x.kind == CLAMP && by == 0.0) {
        const double z = probe(x.of);
        if (x.low >= 0 && z <= ceff[x.low]) return put(x.low, 1.0);
        if (z >= ceff[x.high]) return put(x.high, 1.0);
    }
    put(x.of.c0, by);
    for (int m = 0; m < 3; ++m) {
        const int at = x.of.node[m];
        if (at < 0) continue;
        put(x.of.c[m], by * t[at]);
        if (at < p->n) continue;
        put(p->gain[at - p->n], by * ceff[x.of.c[m]]);
        put(p->offset[at - p->n], by * ceff[x.of.c[m]]);
    }
}

// add(follower, number of its factor, slope of the follower in what the factor's probe reads, that probe)
template <class F>
inline void Evaluation::each_pull(F add) const {
    for (size_t f = 0; f < p->followers.size(); ++f) {
        const Drive& x = p->followers[f];
        for (size_t k = 0; k < x.factors.size(); ++k) {
            const double by = bend[x.factors[k]];
            if (by != 0.0) add(f, k, by * others(x, k), p->factors[x.factors[k]].of);
        }
    }
}

}  // namespace thermid
