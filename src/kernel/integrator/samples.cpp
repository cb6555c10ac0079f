// Controls that sample: at every multiple of their period a state takes a factor's value and keeps it until the next. The instants are known, so
// steps end there and sensitivities take the factor's own.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "network/followers.hpp"

namespace thermid {

// At the start, where eo_ stands; massless nodes have been solved for.
void Integrator::begin_samples() {
    e_.t = eo_.t;
    e_.u = eo_.u;
    e_.set_inputs();
    std::copy(eo_.t.begin(), eo_.t.begin() + n_, T_.begin());
    for (size_t k = 0; k < p_.samplers.size(); ++k) {
        sampled_[k] = static_cast<long>(std::floor(t_ / p_.samplers[k].period)) + 1;
        if (std::isnan(T_[p_.samplers[k].node]) || t_ == 0.0) put_sample(static_cast<int>(k));
    }
    std::copy(T_.begin(), T_.end(), eo_.t.begin());
}

// At the end of a step that has been taken: those that are due, in their order.
void Integrator::sample() {
    bool first = true;
    for (size_t k = 0; k < p_.samplers.size(); ++k) {
        if (!(t_ >= sampled_[k] * p_.samplers[k].period)) continue;
        if (first) {
            for (int i : p_.moving) e_.u[i] = p_.inputs[i].at(t_);
            e_.move_inputs();
            std::copy(T_.begin(), T_.end(), e_.t.begin());
            if (!massless_.nodes.empty()) solve_slaved(massless_, e_);
            first = false;
        }
        put_sample(static_cast<int>(k));
        ++sampled_[k];
    }
}

void Integrator::put_sample(int k) {
    const Sampler& s = p_.samplers[k];
    const size_t np = np_;
    e_.follow();
    if (np > 0) {
        std::vector<double>& row = when_;
        std::fill(row.begin(), row.end(), 0.0);
        const Factor& x = p_.factors[s.factor];
        for (int m = 0; m < 3; ++m)
            if (const int i = x.of.node[m]; i >= 0 && i < n_) axpy(row.data(), e_.bend[s.factor] * e_.ceff[x.of.c[m]], S_.data() + i * np, np_);
        e_.factor_slope(s.factor, [&](int c, double slope) {
            for (int q = d_.indptr[c]; q < d_.indptr[c + 1]; ++q) row[d_.indices[q]] += slope * d_.data[q];
        });
        std::copy(row.begin(), row.end(), S_.begin() + s.node * np);
    }
    T_[s.node] = e_.t[s.node] = e_.factor[s.factor];
}

}  // namespace thermid
