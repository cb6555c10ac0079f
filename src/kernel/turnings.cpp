// Turning points of the courses inside a step of the integrator: of nodes with a delay, those of their polynomials; of the others, and where
// what is left over of a sampled input shows, parabolas through samples.
#include "turnings.hpp"

#include <algorithm>
#include <cmath>

#include "integrator.hpp"

namespace thermid {

namespace {
constexpr int PARTS = 4;  // of a step, where a course is sampled, and halfway between
}  // namespace

// With the inputs of this step: massless nodes and boundaries jump where these do.
void Integrator::turnings_start() {
    start_t_ = e_.t;
}

// Whether what is left over of the inputs hardly moves a node: |b| int |v| <= |b| h sqrt(mean v^2).
bool Integrator::quiet(int node) const {
    double most = 0.0;
    for (int k = 0; k < nk_; ++k)
        if (noise_[k].active) most += std::fabs(noise_[k].b[node]) * h_ * std::sqrt(in_[k].variance);
    return most < Turnings::NOISE;
}

// After an accepted step, before the state moves on; dense() has been called.
void Integrator::turnings_end(const Outputs& out) {
    bool smooth_all = true;
    for (int j = 0; j < out.nobs && smooth_all; ++j) {
        const int i = out.obs[j];
        smooth_all = i < n_ && cap_[i] > 0.0 && !fast_.is[i] && (!leftover_ || quiet(i));
    }
    if (smooth_all && o_.sums.size() == 0) {
        for (int j = 0; j < out.nobs; ++j) turnings_of(j, out.obs[j]);
        return;
    }
    turnings_sampled(out);
}

// The whole network at samples of the step: at the knots of what is left over, just before them, and halfway; else at even parts.
void Integrator::turnings_sampled(const Outputs& out) {
    std::vector<double>& at = seen_times_;
    at.clear();
    if (leftover_) {
        for (int k = 0; k < nk_; ++k) {
            if (!noise_[k].active) continue;
            for (double t = p_.inputs[k].next_knot(t_, -1); t < end_; t = p_.inputs[k].next_knot(t, -1)) {
                if (p_.inputs[k].kind == SAMPLED_HOLD) at.push_back(t - 1e-9 * h_);
                at.push_back(t);
            }
            if (p_.inputs[k].kind == SAMPLED_HOLD) at.push_back(end_ - 1e-9 * h_);
        }
        std::sort(at.begin(), at.end());
        at.erase(std::unique(at.begin(), at.end()), at.end());
        at.erase(std::remove_if(at.begin(), at.end(), [&](double t) { return !(t > t_ && t < end_); }), at.end());
    } else {
        for (int k = 1; k < PARTS; ++k) at.push_back(t_ + h_ * k / PARTS);
    }
    at.push_back(end_);
    std::vector<double>& both = seen_both_;  // and halfway between
    both.assign(1, t_);
    for (double t : at) {
        both.push_back(0.5 * (both.back() + t));
        both.push_back(t);
    }
    at.swap(both);
    const int sums = o_.sums.size(), columns = out.nobs + sums;
    std::vector<double>& y = seen_values_;
    y.resize(at.size() * columns);
    const bool kept = need_u_;
    need_u_ = true;
    for (size_t r = 0; r < at.size(); ++r) {
        double* to = y.data() + r * columns;
        const double* t = r == 0 ? start_t_.data() : e_.t.data();
        if (leftover_ || (r > 0 && r + 1 < at.size())) {
            nodes_at(at[r] == end_ ? h_ : at[r] - t_, at[r], true);
            t = eo_.t.data();
        }
        for (int j = 0; j < out.nobs; ++j) to[j] = t[out.obs[j]];
        for (int k = 0; k < sums; ++k) to[out.nobs + k] = o_.sums.of(k, t);
    }
    need_u_ = kept;
    for (int j = 0; j < columns; ++j) {
        const bool delayed = j < out.nobs && out.obs[j] < n_ && cap_[out.obs[j]] > 0.0 && !fast_.is[out.obs[j]];
        turnings_.see(j, t_, y[j]);
        if (delayed && (!leftover_ || quiet(out.obs[j]))) {
            turnings_of(j, out.obs[j]);
            continue;
        }
        for (size_t r = 2; r < at.size(); r += 2) {
            const double *y0 = y.data() + (r - 2) * columns + j, *y1 = y0 + columns, *y2 = y1 + columns;
            if (at[r] - at[r - 2] > 1e-8 * h_) turnings_.see_three(j, at[r - 2], *y0, at[r - 1], *y1, at[r], *y2);
            else turnings_.see(j, at[r], *y2);  // a jump
        }
    }
}

}  // namespace thermid
