// Turning points of the courses inside a step of the integrator: of nodes with a delay, those of their polynomials; of the others, and where
// what is left over of a sampled input shows, parabolas through samples.
#include "integrator/turnings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "algebra/four.hpp"
#include "integrator/integrator.hpp"
#include "algebra/traces.hpp"

namespace thermid {

namespace {
constexpr int WIDE = 8;   // columns side by side
constexpr int PARTS = 2;  // of a step, where a course is sampled, and halfway between
// Columns whose polynomials have no turning point within the step, and which go on as they went: they move on to their ends. Others are busy.
THERMID_CLONES void go_on(const double* THERMID_RESTRICT c, size_t m, const double* THERMID_RESTRICT y, int count, double end, double small, double flat,
                          double* THERMID_RESTRICT time, double* THERMID_RESTRICT kelvin, const double* THERMID_RESTRICT way, double* THERMID_RESTRICT busy) {
    for (int j = 0; j < count; ++j) {
        const double c1 = c[m + j], c2 = 2.0 * c[2 * m + j], c3 = 3.0 * c[3 * m + j], c4 = 4.0 * c[4 * m + j], c5 = 5.0 * c[5 * m + j];
        const double a = c1 + 0.25 * (c2 + 0.25 * (c3 + 0.25 * (c4 + 0.25 * c5))), b = c1 + 0.5 * (c2 + 0.5 * (c3 + 0.5 * (c4 + 0.5 * c5)));
        const double d = c1 + 0.75 * (c2 + 0.75 * (c3 + 0.75 * (c4 + 0.75 * c5))), e = c1 + c2 + c3 + c4 + c5;
        // One sign: the sum of the magnitudes is the magnitude of the sum.
        const double all = std::fabs(c1) + std::fabs(a) + std::fabs(b) + std::fabs(d) + std::fabs(e), sum = std::fabs(c1 + a + b + d + e);
        const double size = std::fabs(c1) + std::fabs(c2) + std::fabs(c3) + std::fabs(c4) + std::fabs(c5);
        const double up = y[j] - kelvin[j], moved = std::fabs(up), jump = std::fabs(c[j] - kelvin[j]), on = up * way[j];
        const double bends = all - sum > 1e-12 * all ? size : 0.0;  // where its slope changes sign, how much it moves
        double b1 = bends > flat ? 1.0 : 0.0;
        b1 = jump > small ? 1.0 : b1;
        b1 = moved > small ? (on > 0.0 ? b1 : 1.0) : b1;
        b1 = std::fabs(way[j]) == 1.0 ? b1 : 1.0;
        busy[j] = b1;
        const double goes = b1 == 0.0 ? (moved > small ? 1.0 : 0.0) : 0.0;
        time[j] = goes == 1.0 ? end : time[j];
        kelvin[j] = goes == 1.0 ? y[j] : kelvin[j];
    }
}

// A row among those of an interval: the highest and lowest of each column so far, and when.
THERMID_CLONES void spread(const double* THERMID_RESTRICT y, int m, double time, double* THERMID_RESTRICT high, double* THERMID_RESTRICT low,
                           double* THERMID_RESTRICT high_time, double* THERMID_RESTRICT low_time) {
    for (int j = 0; j < m; ++j) {
        const double v = y[j], h = high[j], l = low[j];
        high_time[j] = v > h ? time : high_time[j];
        high[j] = v > h ? v : h;
        low_time[j] = v < l ? time : low_time[j];
        low[j] = v < l ? v : l;
    }
}

// Whether the highest or lowest of any column passes both the output before and this one.
THERMID_CLONES bool passes(const double* THERMID_RESTRICT y, int m, double small, const double* THERMID_RESTRICT high, const double* THERMID_RESTRICT low,
                           const double* THERMID_RESTRICT above, const double* THERMID_RESTRICT below) {
    int64_t many = 0;
    for (int j = 0; j < m; ++j) {
        const double top = y[j] > above[j] ? y[j] : above[j], bottom = y[j] < below[j] ? y[j] : below[j];
        many += (high[j] - top > small) | (bottom - low[j] > small);
    }
    return many > 0;
}

}  // namespace

THERMID_CLONES double Turnings::steepest(const double* b, int count) {
    double most[WIDE] = {};
    int j = 0;
    for (; j + WIDE <= count; j += WIDE)
        for (int l = 0; l < WIDE; ++l) most[l] = std::fabs(b[j + l]) > most[l] ? std::fabs(b[j + l]) : most[l];
    for (; j < count; ++j) most[0] = std::max(most[0], std::fabs(b[j]));
    return *std::max_element(most, most + WIDE);
}

THERMID_CLONES double Turnings::most_bent(const double* c, std::size_t m, int count) {
    const auto of = [=](int j) {
        return 2.0 * std::fabs(c[2 * m + j]) + 6.0 * std::fabs(c[3 * m + j]) + 12.0 * std::fabs(c[4 * m + j]) + 20.0 * std::fabs(c[5 * m + j]);
    };
    double most[WIDE] = {};
    int j = 0;
    for (; j + WIDE <= count; j += WIDE)
        for (int l = 0; l < WIDE; ++l) most[l] = of(j + l) > most[l] ? of(j + l) : most[l];
    for (; j < count; ++j) most[0] = std::max(most[0], of(j));
    return *std::max_element(most, most + WIDE);
}

void Turnings::see_polynomials(int first, int count, const double* c, std::size_t stride, double t, double h, double end, const double* y) {
    if (open_) close();
    double* busy = busy_.data() + first;
    go_on(c, stride, y, count, end, SMALL, FLAT, time_.data() + first, kelvin_.data() + first, way_.data() + first, busy);
    for (int j = 0; j < count; ++j)
        if (busy[j] != 0.0) see_polynomial(first + j, c + j, stride, t, h, end, y[j]);
}

void Turnings::open() {
    const size_t m = columns_.size();
    const double inf = std::numeric_limits<double>::infinity();
    high_ = low_ = kelvin_;
    high_time_ = low_time_ = time_;
    above_.assign(m, -inf);
    below_.assign(m, inf);
    for (size_t j = 0; j < m; ++j)
        if (way_[j] == NEW) {
            high_[j] = -inf;
            low_[j] = inf;
        }
    open_ = true;
}

// The highest and lowest since the last output of a column.
void Turnings::note(int j) {
    const bool first = high_time_[j] < low_time_[j];
    turn(j, first ? high_time_[j] : low_time_[j], first ? high_[j] : low_[j]);
    turn(j, first ? low_time_[j] : high_time_[j], first ? low_[j] : high_[j]);
}

void Turnings::close() {
    open_ = false;
    for (int j = 0; j < static_cast<int>(columns_.size()); ++j)
        if (high_[j] >= low_[j] && (high_[j] > above_[j] || low_[j] < below_[j])) note(j);
}

void Turnings::see_rows(const double* times, long rows, const double* y) {
    const int m = static_cast<int>(columns_.size());
    if (!open_) open();
    long next = std::lower_bound(times_, times_ + n_, times[0]) - times_;
    for (long r = 0; r < rows; ++r, y += m) {
        if (r + 1 == rows)
            for (int j = 0; j < m; ++j) {
                const double before = r > 0 ? y[j - m] : kelvin_[j];
                way_[j] = y[j] < before ? -1.0 : 1.0;
                time_[j] = times[r];
                kelvin_[j] = y[j];
            }
        while (next < n_ && times_[next] < times[r]) ++next;
        if (!(next < n_ && times_[next] == times[r])) {
            spread(y, m, times[r], high_.data(), low_.data(), high_time_.data(), low_time_.data());
            continue;
        }
        if (passes(y, m, NOISE, high_.data(), low_.data(), above_.data(), below_.data()))
            for (int j = 0; j < m; ++j) {
                const double over = high_[j] - std::max(y[j], above_[j]), under = std::min(y[j], below_[j]) - low_[j];
                if (over > NOISE && under > NOISE) note(j);
                else if (over > NOISE) turn(j, high_time_[j], high_[j]);
                else if (under > NOISE) turn(j, low_time_[j], low_[j]);
            }
        for (auto* v : {&high_, &low_, &above_, &below_}) std::copy(y, y + m, v->begin());
        for (auto* v : {&high_time_, &low_time_}) std::fill(v->begin(), v->end(), times[r]);
    }
}

void Turnings::among_outputs(std::vector<double>& times, long next, double end, double gap) const {
    long last = next;
    double widest = 0.0;
    for (; last < n_ && times_[last] <= end; ++last) widest = std::max(widest, last > 0 ? times_[last] - times_[last - 1] : 0.0);
    if (last < n_ && last > 0) widest = std::max(widest, times_[last] - times_[last - 1]);
    if (n_ > 0 && last > next && widest <= gap) {
        times.clear();
        next = last - 1;
    }
    const size_t knots = times.size();
    times.insert(times.end(), times_ + next, times_ + last);
    times.push_back(end);
    std::inplace_merge(times.begin(), times.begin() + knots, times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
}

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

// The nodes that columns are made of: those observed, then those in sums; and the parts of the sums, by place among these or by coefficient.
void Integrator::follow(const Outputs& out) {
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
Integrator::Unrest Integrator::unrest() const {
    Unrest all;
    for (int k = 0; k < nk_; ++k) {
        if (!noise_[k].active) continue;
        double b = 0.0, direct = 0.0;
        for (int i : followed_) b = std::max(b, std::fabs(noise_[k].b[i]));
        for (const auto& parts : sum_parts_)
            for (const SumPart& x : parts)
                if (x.input == k) direct = std::max(direct, std::fabs(x.weight));
        const double spread = h_ * std::sqrt(in_[k].variance);  // |int v| is no more
        if (direct == 0.0 && b * spread < 0.1 * Turnings::NOISE) {
            all.moved += b * spread;
            all.rate += b * spread / h_;
            continue;
        }
        const double most = p_.inputs[k].furthest(in_[k], t_, end_, hint_[k]);
        all.rate += b * most;
        all.moved += b * h_ * std::min(0.5 * most, std::sqrt(in_[k].variance));
        all.direct += direct * most;
        all.jumps = all.jumps || (direct * most > Turnings::NOISE && p_.inputs[k].kind == SAMPLED_HOLD);
    }
    return all;
}

// After an accepted step, before the state moves on; dense() has been called.
void Integrator::turnings_end(const Outputs& out) {
    if (followed_.empty()) follow(out);
    if (!polynomial_ || !delayed(followed_.data(), static_cast<int>(followed_.size()))) return turnings_sampled(out);
    const Unrest x = leftover_ ? unrest() : Unrest();
    if (x.jumps) return turnings_sampled(out);
    if (x.moved + x.direct < Turnings::NOISE) return turnings_smooth(out);
    double bend = 0.0;
    for (int i : followed_) bend = std::max(bend, Turnings::most_bent(poly_.data() + i, n_, 1));
    turnings_knots(out, x.direct > Turnings::NOISE ? 0.0 : Turnings::gap(x.rate, bend / (h_ * h_)));
}

// Turning points of the polynomials of nodes and sums.
void Integrator::turnings_smooth(const Outputs& out) {
    int first = 0;
    while (first < out.nobs && out.obs[first] == out.obs[0] + first) ++first;  // nodes in their own order, side by side
    if (first > 0) turnings_.see_polynomials(0, first, poly_.data() + out.obs[0], n_, t_, h_, end_, T1_.data() + out.obs[0]);
    for (int j = first; j < out.nobs; ++j) turnings_.see_polynomials(j, 1, poly_.data() + out.obs[j], n_, t_, h_, end_, T1_.data() + out.obs[j]);
    for (int r = 0; r < o_.sums.size(); ++r) {
        double c[POWERS] = {};
        for (const SumPart& x : sum_parts_[r]) {
            for (int m = 0; x.place >= 0 && m < POWERS; ++m) c[m] += x.weight * poly_[static_cast<size_t>(m) * n_ + followed_[x.place]];
            if (x.place >= 0) continue;
            if (x.input < 0 || !p_.inputs[x.input].sampled()) {
                c[0] += x.weight * (x.input < 0 ? 1.0 : p_.inputs[x.input].mean);
                continue;
            }
            const StepInput& u = in_[x.input];
            c[0] += x.weight * (u.base + u.p0);
            c[1] += x.weight * u.p1 * h_;
            c[2] += x.weight * u.p2 * h_ * h_;
        }
        const double y = c[0] + c[1] + c[2] + c[3] + c[4] + c[5];
        turnings_.see_polynomials(out.nobs + r, 1, c, 1, t_, h_, end_, &y);
    }
}

// At the knots of what is left over that are more than `gap` apart, but for those at which outputs are.
void Integrator::turnings_knots(const Outputs& out, double gap) {
    std::vector<double>& at = seen_times_;
    at.clear();
    int active = 0;
    for (int k = 0; k < nk_; ++k) {
        if (!noise_[k].active) continue;
        p_.inputs[k].knots(t_, end_, at, gap);
        ++active;
    }
    if (active > 1) std::sort(at.begin(), at.end());
    turnings_.among_outputs(at, out.next, end_, gap);
    count_ = POWERS + 4 * active;
    slope_count_ = POWERS + 2 * active;
    const int sums = o_.sums.size(), wide = static_cast<int>(followed_.size()), columns = out.nobs + sums;
    const long many = static_cast<long>(at.size());
    seen_values_.resize(static_cast<size_t>(many) * wide);
    rows(at.data(), many, followed_.data(), wide, seen_values_.data(), nullptr);
    if (sums == 0) return turnings_.see_rows(at.data(), many, seen_values_.data());
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
    turnings_.see_rows(at.data(), many, seen_both_.data());
}

// The whole network at samples of the step: at the knots of what is left over, just before them, and halfway; else at even parts.
void Integrator::turnings_sampled(const Outputs& out) {
    std::vector<double>& at = seen_times_;
    at.clear();
    if (leftover_) {
        for (int k = 0; k < nk_; ++k) {
            if (!noise_[k].active) continue;
            const size_t first = at.size();
            p_.inputs[k].knots(t_, end_, at);
            if (p_.inputs[k].kind == SAMPLED_HOLD)
                for (size_t r = first, last = at.size(); r < last; ++r) at.push_back(at[r] - 1e-9 * h_);
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
