// Turning points of the courses inside a step: of nodes with a delay, those of their polynomials; of the others, and where what is left over
// of a sampled input shows, parabolas through samples.
#include <algorithm>
#include <cmath>

#include "algebra/traces.hpp"
#include "integrator/outputs.hpp"

namespace thermid {

namespace {
constexpr int PARTS = 2;  // of a step, where a course is sampled, and halfway between
}  // namespace

// With the inputs of this step: massless nodes and boundaries jump where these do.
void Outputs::turnings_start() {
    start_t_ = step_.e.t;
}

// Whether what is left over of the inputs hardly moves a node: |b| int |v| <= |b| h sqrt(mean v^2).
bool Outputs::quiet(int node) const {
    double most = 0.0;
    for (int k = 0; k < nk_; ++k)
        if (step_.noise[k].active) most += std::fabs(step_.noise[k].b[node]) * step_.h * std::sqrt(step_.in[k].variance);
    return most < Turnings::NOISE;
}

// The nodes that columns are made of: those observed, then those in sums; and the parts of the sums, by place among these or by coefficient.
void Outputs::follow(const OutputList& out) {
    followed_.assign(out.obs, out.obs + out.nobs);
    polynomial_ = true;
    sum_parts_.assign(o_.sums.size(), {});
    for (int r = 0; r < o_.sums.size(); ++r)
        for (int j = o_.sums.begin[r]; j < o_.sums.begin[r + 1]; ++j) {
            const int i = o_.sums.node[j];
            const double weight = o_.sums.weight[j];
            if (i < n_) {
                auto at = std::find(followed_.begin(), followed_.end(), i);
                if (at == followed_.end()) at = followed_.insert(at, i);
                sum_parts_[r].push_back({static_cast<int>(at - followed_.begin()), -1, weight});
                continue;
            }
            for (int c : {p_.gain[i - n_], p_.offset[i - n_]}) {
                if (c >= p_.nc) continue;
                const int k = p_.coef_input[c];
                polynomial_ = polynomial_ && !(k >= 0 && p_.inputs[k].kind == SINE && p_.inputs[k].amplitude != 0.0);
                sum_parts_[r].push_back({-1, k, weight * coef_[c]});
            }
        }
}

// By how much what is left over of the inputs in this step may move a column between knots that lie `gap` apart, at the knots and, in sums with
// boundaries, at once. With |v| <= most, int v = 0 over the step: |int v| <= most h / 2, and from a knot no further than gap away, most gap / 2.
Outputs::Unrest Outputs::unrest() const {
    Unrest all;
    for (int k = 0; k < nk_; ++k) {
        if (!step_.noise[k].active) continue;
        double b = 0.0, direct = 0.0;
        for (int i : followed_) b = std::max(b, std::fabs(step_.noise[k].b[i]));
        for (const auto& parts : sum_parts_)
            for (const SumPart& x : parts)
                if (x.input == k) direct = std::max(direct, std::fabs(x.weight));
        const double spread = step_.h * std::sqrt(step_.in[k].variance);  // |int v| is no more
        if (direct == 0.0 && b * spread < 0.1 * Turnings::NOISE) {
            all.moved += b * spread;
            all.rate += b * spread / step_.h;
            continue;
        }
        const double most = p_.inputs[k].furthest(step_.in[k], state_.t, step_.end, step_.hint[k]);
        all.rate += b * most;
        all.moved += b * step_.h * std::min(0.5 * most, std::sqrt(step_.in[k].variance));
        all.direct += direct * most;
        all.jumps = all.jumps || (direct * most > Turnings::NOISE && p_.inputs[k].kind == SAMPLED_HOLD);
    }
    return all;
}

// After an accepted step, before the state moves on; dense() has been called.
void Outputs::turnings_end(const OutputList& out) {
    if (followed_.empty()) follow(out);
    if (!polynomial_ || !delayed(followed_.data(), static_cast<int>(followed_.size()))) return turnings_sampled(out);
    const Unrest x = step_.leftover ? unrest() : Unrest();
    if (x.jumps) return turnings_sampled(out);
    if (x.moved + x.direct < Turnings::NOISE) return turnings_smooth(out);
    double bend = 0.0;
    for (int i : followed_) bend = std::max(bend, Turnings::most_bent(poly_.data() + i, n_, 1));
    turnings_knots(out, x.direct > Turnings::NOISE ? 0.0 : Turnings::gap(x.rate, bend / (step_.h * step_.h)));
}

// Turning points of the polynomials of nodes and sums.
void Outputs::turnings_smooth(const OutputList& out) {
    int first = 0;
    while (first < out.nobs && out.obs[first] == out.obs[0] + first) ++first;  // nodes in their own order, side by side
    if (first > 0) turnings.see_polynomials(0, first, poly_.data() + out.obs[0], n_, state_.t, step_.h, step_.end, step_.T1.data() + out.obs[0]);
    for (int j = first; j < out.nobs; ++j) turnings.see_polynomials(j, 1, poly_.data() + out.obs[j], n_, state_.t, step_.h, step_.end, step_.T1.data() + out.obs[j]);
    for (int r = 0; r < o_.sums.size(); ++r) {
        double c[POWERS] = {};
        for (const SumPart& x : sum_parts_[r]) {
            for (int m = 0; x.place >= 0 && m < POWERS; ++m) c[m] += x.weight * poly_[static_cast<size_t>(m) * n_ + followed_[x.place]];
            if (x.place >= 0) continue;
            if (x.input < 0 || !p_.inputs[x.input].sampled()) {
                c[0] += x.weight * (x.input < 0 ? 1.0 : p_.inputs[x.input].mean);
                continue;
            }
            const StepInput& u = step_.in[x.input];
            c[0] += x.weight * (u.base + u.p0);
            c[1] += x.weight * u.p1 * step_.h;
            c[2] += x.weight * u.p2 * step_.h * step_.h;
        }
        const double y = c[0] + c[1] + c[2] + c[3] + c[4] + c[5];
        turnings.see_polynomials(out.nobs + r, 1, c, 1, state_.t, step_.h, step_.end, &y);
    }
}

// At the knots of what is left over that are more than `gap` apart, but for those at which outputs are.
void Outputs::turnings_knots(const OutputList& out, double gap) {
    std::vector<double>& at = seen_times_;
    at.clear();
    int active = 0;
    for (int k = 0; k < nk_; ++k) {
        if (!step_.noise[k].active) continue;
        p_.inputs[k].knots(state_.t, step_.end, at, gap);
        ++active;
    }
    if (active > 1) std::sort(at.begin(), at.end());
    turnings.among_outputs(at, out.next, step_.end, gap);
    count_ = POWERS + 4 * active;
    slope_count_ = POWERS + 2 * active;
    const int sums = o_.sums.size(), wide = static_cast<int>(followed_.size()), columns = out.nobs + sums;
    const long many = static_cast<long>(at.size());
    seen_values_.resize(static_cast<size_t>(many) * wide);
    rows(at.data(), many, followed_.data(), wide, seen_values_.data(), nullptr);
    if (sums == 0) return turnings.see_rows(at.data(), many, seen_values_.data());
    seen_both_.resize(static_cast<size_t>(many) * columns);
    int hint = -1;
    for (long r = 0; r < many; ++r) {
        const double* y = seen_values_.data() + r * wide;
        double* to = seen_both_.data() + r * columns;
        std::copy(y, y + out.nobs, to);
        for (int q = 0; q < sums; ++q) {
            double v = 0.0;
            for (const SumPart& x : sum_parts_[q]) v += x.weight * (x.place >= 0 ? y[x.place] : x.input < 0 ? 1.0 : p_.inputs[x.input].at(at[r], hint));
            to[out.nobs + q] = v;
        }
    }
    turnings.see_rows(at.data(), many, seen_both_.data());
}

// The whole network at samples of the step: at the knots of what is left over, just before them, and halfway; else at even parts.
void Outputs::turnings_sampled(const OutputList& out) {
    std::vector<double>& at = seen_times_;
    at.clear();
    if (step_.leftover) {
        for (int k = 0; k < nk_; ++k) {
            if (!step_.noise[k].active) continue;
            const size_t first = at.size();
            p_.inputs[k].knots(state_.t, step_.end, at);
            if (p_.inputs[k].kind == SAMPLED_HOLD)
                for (size_t r = first, last = at.size(); r < last; ++r) at.push_back(at[r] - 1e-9 * step_.h);
            if (p_.inputs[k].kind == SAMPLED_HOLD) at.push_back(step_.end - 1e-9 * step_.h);
        }
        std::sort(at.begin(), at.end());
        at.erase(std::unique(at.begin(), at.end()), at.end());
        at.erase(std::remove_if(at.begin(), at.end(), [&](double t) { return !(t > state_.t && t < step_.end); }), at.end());
    } else {
        for (int k = 1; k < PARTS; ++k) at.push_back(state_.t + step_.h * k / PARTS);
    }
    at.push_back(step_.end);
    std::vector<double>& both = seen_both_;  // and halfway between
    both.assign(1, state_.t);
    for (double t : at) {
        both.push_back(0.5 * (both.back() + t));
        both.push_back(t);
    }
    at.swap(both);
    const int sums = o_.sums.size(), columns = out.nobs + sums;
    std::vector<double>& y = seen_values_;
    y.resize(at.size() * columns);
    const bool kept = need_u;
    need_u = true;
    for (size_t r = 0; r < at.size(); ++r) {
        double* to = y.data() + r * columns;
        const double* t = r == 0 ? start_t_.data() : step_.e.t.data();
        if (step_.leftover || (r > 0 && r + 1 < at.size())) {
            nodes_at(at[r] == step_.end ? step_.h : at[r] - state_.t, at[r], true);
            t = view.t.data();
        }
        for (int j = 0; j < out.nobs; ++j) to[j] = t[out.obs[j]];
        for (int k = 0; k < sums; ++k) to[out.nobs + k] = o_.sums.of(k, t);
    }
    need_u = kept;
    for (int j = 0; j < columns; ++j) {
        const bool delayed = j < out.nobs && out.obs[j] < n_ && setup_.cap[out.obs[j]] > 0.0 && !slaved_.fast.is[out.obs[j]];
        turnings.see(j, state_.t, y[j]);
        if (delayed && (!step_.leftover || quiet(out.obs[j]))) {
            turnings_of(j, out.obs[j]);
            continue;
        }
        for (size_t r = 2; r < at.size(); r += 2) {
            const double *y0 = y.data() + (r - 2) * columns + j, *y1 = y0 + columns, *y2 = y1 + columns;
            if (at[r] - at[r - 2] > 1e-8 * step_.h) turnings.see_three(j, at[r - 2], *y0, at[r - 1], *y1, at[r], *y2);
            else turnings.see(j, at[r], *y2);  // a jump
        }
    }
}

}  // namespace thermid
