// Turning points of the courses inside a step of the integrator: of nodes with a delay, those of their polynomials; of the others, and where
// what is left over of a sampled input shows, parabolas through samples.
#include "integrator/turnings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "algebra/four.hpp"
#include "algebra/traces.hpp"

namespace thermid {

namespace {
constexpr int WIDE = 8;   // columns side by side
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

}  // namespace thermid
