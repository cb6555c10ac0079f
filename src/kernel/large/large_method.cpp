// How fast a large network's nodes would settle, and which method that calls for.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "large/large.hpp"

namespace thermid {

namespace {
// Cost of a step of length h, in sweeps: RKC2 sqrt(1.54 h largest rate); TR-BDF2 two solves of about three times sqrt(2 (1 + 0.29 h mean
// rate)) gradients. They are equal at a ratio of rates of about 14.
constexpr double RATIO = 14.0;
}  // namespace

// Bound of the rate that rows add to the links', by Gershgorin [1/s].
double LargeRun::row_rate() {
    rates_ = start_.slope;
    for (const RowGroup& g : p_.rows) {
        if (g.boundary >= 0) continue;
        for (int r = g.begin; r < g.end; ++r)
            for (int place : {p_.a_slot[r], p_.b_slot[r]}) rates_[place] += 2.0 * std::fabs(start_.pair[r]);
    }
    double worst = 0.0;
    for (size_t k = 0; k < p_.special.size(); ++k) worst = std::max(worst, rates_[k] * settles_[p_.special[k]]);
    return worst;
}

// Largest rate of decay by the links alone: Lanczos in the inner product of the capacities, 1.05 times the largest Ritz value plus its
// residual, never above Gershgorin's bound.
double LargeRun::lanczos() {
    double bound = 0.0;
    for (int i = 0; i < n_; ++i) bound = std::max(bound, 2.0 * link_sum_[i] * settles_[i]);
    Field v(p_.links);
    std::vector<double> before(n_, 0.0), w(n_), alpha, beta;
    unsigned long long seed = 88172645463325252ULL;
    double norm = 0.0;
    for (int i = 0; i < n_; ++i) {  // xorshift, alternating enough to meet the roughest mode
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        v[i] = static_cast<double>(seed >> 11) / 9007199254740992.0 - 0.5;
        norm += p_.heavy[i] * v[i] * v[i];
    }
    for (int i = 0; i < n_; ++i) v[i] /= std::sqrt(norm);
    double top = 0.0, left = 0.0;
    for (int k = 0; k < 40 && k < n_; ++k) {
        p_.links.flow(v.data(), w.data());
        polled();
        double a = 0.0, b = 0.0;
        for (int i = 0; i < n_; ++i) a -= v[i] * w[i];
        alpha.push_back(a);
        for (int i = 0; i < n_; ++i) {
            w[i] = -w[i] * settles_[i] - a * v[i] - (k ? beta.back() * before[i] : 0.0);
            b += p_.heavy[i] * w[i] * w[i];
        }
        b = std::sqrt(b);
        // Largest eigenvalue of the tridiagonal matrix by bisection on the signs of its pivots.
        double low = top, high = bound + 1e-300;
        for (int it = 0; it < 50; ++it) {
            const double x = 0.5 * (low + high);
            double d = 1.0;
            bool above = true;
            for (size_t j = 0; j < alpha.size() && above; ++j) {
                d = x - alpha[j] - (j ? beta[j - 1] * beta[j - 1] / d : 0.0);
                above = d > 0.0;
            }
            (above ? high : low) = x;
        }
        left = high - top;
        top = high;
        if (b <= 1e-10 * bound || (k > 10 && left < 1e-3 * top)) break;
        beta.push_back(b);
        for (int i = 0; i < n_; ++i) {
            before[i] = v[i];
            v[i] = w[i] / b;
        }
    }
    return std::min(bound, 1.05 * (top + left));
}

void LargeRun::choose() {
    double links = 0.0, capacity = 0.0, worst = 0.0;
    for (int i = 0; i < n_; ++i) {
        links += link_sum_[i];
        capacity += p_.capacity[i];
        worst = std::max(worst, link_sum_[i] * settles_[i]);
    }
    for (size_t k = 0; k < p_.special.size(); ++k) links += start_.slope[k];
    mean_rate_ = capacity > 0.0 ? links / capacity : 0.0;
    r_->method = o_.method;
    if (o_.method == AUTO) {
        link_rate_ = massless_.empty() ? lanczos() : 0.0;
        r_->method = !massless_.empty() || link_rate_ + row_rate() > RATIO * mean_rate_ ? TRBDF2 : RKC2;
    } else if (o_.method == RKC2) {
        if (!massless_.empty()) fail(SINGULAR_NODE);
        link_rate_ = lanczos();
    }
    if (r_->method == RKC2) {
        z1_ = Field(p_.links);
        z2_ = Field(p_.links);
        if (!p_.stored.empty()) {
            dT_ = Field(p_.links);
            w_.assign(n_, 0.0);
        }
        moving_heat_.resize(p_.moving);
        moving_c_.resize(p_.moving);
        for (int k = 0; k < p_.moving; ++k) moving_c_[k] = inverse_c_[p_.special[k]];
        return;
    }
    if (link_rate_ == 0.0) link_rate_ = 2.0 * worst;
    x_ = Field(p_.links);
    p1_ = Field(p_.links);
    for (auto* v : {&heat0_, &heat1_, &heat2_, &z_, &base_, &r_v_, &w_, &diag_}) v->assign(n_, 0.0);
    bend_.assign(massless_.size(), 0.0);
    if (p_.stored.empty()) return;
    weighed_ = Field(p_.links);
    root_.assign(n_, 1.0);
    kept_.assign(n_, 0.0);
}

}  // namespace thermid
