// Turning points of the courses inside a step of the integrator: of nodes with a delay, those of their polynomials; of the others, and where
// what is left over of a sampled input shows, parabolas through samples.
#include "turnings.hpp"

#include <algorithm>
#include <cmath>

#include "four.hpp"
#include "integrator.hpp"
#include "traces.hpp"

namespace thermid {

namespace {
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

// A row among those of an interval: the highest and lowest of each column so far, and in which row.
THERMID_CLONES void spread(const double* THERMID_RESTRICT y, int m, double row, double* THERMID_RESTRICT high, double* THERMID_RESTRICT low,
                           double* THERMID_RESTRICT high_row, double* THERMID_RESTRICT low_row) {
    for (int j = 0; j < m; ++j) {
        const double v = y[j], h = high[j], l = low[j];
        high_row[j] = v > h ? row : high_row[j];
        high[j] = v > h ? v : h;
        low_row[j] = v < l ? row : low_row[j];
        low[j] = v < l ? v : l;
    }
}

}  // namespace

void Turnings::see_polynomials(int first, int count, const double* c, std::size_t stride, double t, double h, double end, const double* y) {
    double* busy = busy_.data() + first;
    go_on(c, stride, y, count, end, SMALL, FLAT, time_.data() + first, kelvin_.data() + first, way_.data() + first, busy);
    for (int j = 0; j < count; ++j)
        if (busy[j] != 0.0) see_polynomial(first + j, c + j, stride, t, h, end, y[j]);
}

void Turnings::see_rows(const double* times, long rows, const double* y) {
    const int m = static_cast<int>(columns_.size());
    for (auto* v : {&high_, &low_, &high_row_, &low_row_}) v->resize(m);
    long next = std::lower_bound(times_, times_ + n_, times[0]) - times_;
    for (long first = 0, last; first < rows; first = last) {
        while (next < n_ && times_[next] < times[first]) ++next;
        last = first + 1;
        while (last < rows && !(next < n_ && times[last] > times_[next])) ++last;
        if (last == rows && rows - first == 1) break;  // the end alone
        for (int j = 0; j < m; ++j) {
            high_[j] = low_[j] = y[first * m + j];
            high_row_[j] = low_row_[j] = static_cast<double>(first);
        }
        for (long r = first + 1; r < last; ++r) spread(y + r * m, m, static_cast<double>(r), high_.data(), low_.data(), high_row_.data(), low_row_.data());
        for (int j = 0; j < m; ++j) {
            const long high = static_cast<long>(high_row_[j]), low = static_cast<long>(low_row_[j]);
            vertex(j, std::min(high, low), times, rows, y);
            vertex(j, std::max(high, low), times, rows, y);
        }
    }
    for (int j = 0; j < m; ++j) see(j, times[rows - 1], y[(rows - 1) * m + j]);
}

void Turnings::vertex(int j, long r, const double* times, long rows, const double* y) {
    const std::size_t m = columns_.size();
    const double y1 = y[r * m + j];
    if (r > 0 && r + 1 < rows) {
        const double t0 = times[r - 1], t1 = times[r], t2 = times[r + 1], y0 = y[(r - 1) * m + j], y2 = y[(r + 1) * m + j];
        if ((y1 - y0) * (y2 - y1) < 0.0) {  // the slope at the middle row, and how it bends
            const double a = (y1 - y0) / (t1 - t0), b = (y2 - y1) / (t2 - t1);
            const double bend = (b - a) / (t2 - t0), slope = a + bend * (t1 - t0), s = -0.5 * slope / bend;
            if (t1 + s > t0 && t1 + s < t2) return see(j, t1 + s, y1 + 0.5 * slope * s);
        }
    }
    see(j, times[r], y1);
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
        const double most = p_.inputs[k].furthest(in_[k], t_, end_, hint_[k]);
        double b = 0.0, direct = 0.0;
        for (int i : followed_) b = std::max(b, std::fabs(noise_[k].b[i]));
        for (const auto& parts : sum_parts_)
            for (const SumPart& x : parts)
                if (x.input == k) direct = std::max(direct, std::fabs(x.weight));
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
    turnings_knots(out, x.direct > Turnings::NOISE ? 0.0 : std::min(Turnings::NOISE / x.rate, h_ / 8));
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
    at.push_back(end_);
    long next = out.next;
    const auto stored = [&](double t) {
        while (next < out.n && out.t[next] < t) ++next;
        return next < out.n && out.t[next] == t;
    };
    at.erase(std::remove_if(at.begin(), at.end() - 1, stored), at.end() - 1);
    at.erase(std::unique(at.begin(), at.end()), at.end());
    count_ = POWERS + 4 * active;
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
