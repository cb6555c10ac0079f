// Controls that sample: at every multiple of their period a state takes a factor's value and keeps it until the next. The instants are known, so
// steps end there and sensitivities take the factor's own.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "network/followers.hpp"

namespace thermid {

// At the start, where outputs_.view stands; massless nodes have been solved for.
void Integrator::begin_samples() {
    step_.e.t = outputs_.view.t;
    step_.e.u = outputs_.view.u;
    step_.e.set_inputs();
    std::copy(outputs_.view.t.begin(), outputs_.view.t.begin() + n_, state_.T.begin());
    for (size_t k = 0; k < p_.samplers.size(); ++k) {
        state_.sampled[k] = static_cast<long>(std::floor(state_.t / p_.samplers[k].period)) + 1;
        if (std::isnan(state_.T[p_.samplers[k].node]) || state_.t == 0.0) put_sample(static_cast<int>(k));
    }
    std::copy(state_.T.begin(), state_.T.end(), outputs_.view.t.begin());
}

// At the end of a step that has been taken: those that are due, in their order.
void Integrator::sample() {
    bool first = true;
    for (size_t k = 0; k < p_.samplers.size(); ++k) {
        if (!(state_.t >= state_.sampled[k] * p_.samplers[k].period)) continue;
        if (first) {
            for (int i : p_.moving) step_.e.u[i] = p_.inputs[i].at(state_.t);
            step_.e.move_inputs();
            std::copy(state_.T.begin(), state_.T.end(), step_.e.t.begin());
            if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, step_.e);
            first = false;
        }
        put_sample(static_cast<int>(k));
        ++state_.sampled[k];
    }
}

void Integrator::put_sample(int k) {
    const Sampler& s = p_.samplers[k];
    const size_t np = np_;
    step_.e.follow();
    if (np > 0) {
        std::vector<double>& row = when_;
        std::fill(row.begin(), row.end(), 0.0);
        const Factor& x = p_.factors[s.factor];
        for (int m = 0; m < 3; ++m)
            if (const int i = x.of.node[m]; i >= 0 && i < n_) axpy(row.data(), step_.e.bend[s.factor] * step_.e.ceff[x.of.c[m]], state_.S.data() + i * np, np_);
        step_.e.factor_slope(s.factor, [&](int c, double slope) {
            for (int q = d_.indptr[c]; q < d_.indptr[c + 1]; ++q) row[d_.indices[q]] += slope * d_.data[q];
        });
        std::copy(row.begin(), row.end(), state_.S.begin() + s.node * np);
    }
    state_.T[s.node] = step_.e.t[s.node] = step_.e.factor[s.factor];
}

}  // namespace thermid
