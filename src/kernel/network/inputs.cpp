#include "network/inputs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "algebra/linear.hpp"

namespace thermid {

namespace {
constexpr double TWO_PI = 6.283185307179586476925;

// Integral of the square of a straight line.
double line_square(double length, double u, double slope) {
    const double d = slope * length;
    return length * (u * (u + d) + d * d / 3.0);
}
}

void Input::set_samples(const double* times, const double* values, int m) {
    // The level is one of the samples in the middle: an absurd value somewhere must not cost the others their digits, as it would in a mean.
    std::vector<double> ordered(values, values + m);
    std::nth_element(ordered.begin(), ordered.begin() + m / 2, ordered.end());
    mean = ordered[m / 2];
    seg.clear();
    for (int i = 0; i < m; ++i) {
        const double s = (kind == 0 && i + 1 < m) ? (values[i + 1] - values[i]) / (times[i + 1] - times[i]) : 0.0;
        const double u = values[i] - mean;
        // A knot at which nothing changes is no knot.
        if (!seg.empty() && s == seg.back().s && (s == 0.0 ? u == seg.back().u : false)) continue;
        seg.push_back({times[i], u, s});
    }
    sum_blocks();
}

void Input::sum_blocks() {
    block.clear();
    block_square.clear();
    for (size_t b = 0; (b + 1) * BLOCK < seg.size(); ++b) {
        Integrals total;
        double square = 0.0;
        for (size_t i = b * BLOCK; i < (b + 1) * BLOCK; ++i) {
            const double l = seg[i + 1].t - seg[i].t;
            total.append_line(l, seg[i].u, seg[i].s);
            square += line_square(l, seg[i].u, seg[i].s);
        }
        block.push_back(total);
        block_square.push_back(square);
    }
}

double Input::square(double t0, int i0, double t1, int i1) const {
    double total = 0.0, from = t0;
    for (int i = i0; i <= i1;) {
        if (i >= 0 && i % BLOCK == 0 && i + BLOCK <= i1 && from == seg[i].t) {
            total += block_square[i / BLOCK];
            i += BLOCK;
            from = seg[i].t;
            continue;
        }
        const double to = i < i1 ? seg[i + 1].t : t1;
        total += i < 0 ? line_square(to - from, seg[0].u, 0.0) : line_square(to - from, seg[i].u + seg[i].s * (from - seg[i].t), seg[i].s);
        from = to;
        ++i;
    }
    return total;
}

int Input::segment(double t, int hint) const {
    const int m = static_cast<int>(seg.size());
    if (hint >= 0 && hint < m && seg[hint].t <= t) {
        for (int k = 0; k < 4; ++k, ++hint)
            if (hint + 1 >= m || seg[hint + 1].t > t) return hint;
    }
    auto it = std::upper_bound(seg.begin(), seg.end(), t, [](double x, const Segment& s) { return x < s.t; });
    return static_cast<int>(it - seg.begin()) - 1;
}

double Input::at(double t) const {
    if (kind > 2) return mean;
    if (kind == 2) return mean + amplitude * std::sin(TWO_PI * t / period + phase);
    const int i = segment(t, -1);
    return i < 0 ? mean + seg[0].u : mean + seg[i].u + seg[i].s * (t - seg[i].t);
}

double Input::at(double t, int& hint) const {
    if (!sampled()) return at(t);
    const int i = hint = segment(t, hint);
    return i < 0 ? mean + seg[0].u : mean + seg[i].u + seg[i].s * (t - seg[i].t);
}

void Input::knots(double t0, double t1, std::vector<double>& out, double gap) const {
    const int m = static_cast<int>(seg.size());
    int last = segment(t0, -1);
    for (int i = last + 1; i < m && seg[i].t < t1; ++i) {
        if (i + 1 < m && seg[i + 1].t < t1 && seg[i + 1].t - std::max(t0, last < 0 ? t0 : seg[last].t) < gap) continue;
        if (i - last >= BLOCK) i -= i % BLOCK;
        if (seg[i].t > t0) out.push_back(seg[i].t);
        last = i;
    }
}

double Input::furthest(const StepInput& x, double t0, double t1, int hint) const {
    double low = 0.0, high = 0.0;
    const auto see = [&](double s, double u) {
        const double v = u - (x.p0 + s * (x.p1 + s * x.p2));
        low = v < low ? v : low;
        high = v > high ? v : high;
    };
    const int m = static_cast<int>(seg.size());
    int i = segment(t0, hint);
    see(0.0, i < 0 ? seg[0].u : seg[i].u + seg[i].s * (t0 - seg[i].t));
    const bool held = kind == 1;
    double lows[4] = {}, highs[4] = {};  // four knots at a time
    for (++i; !held && i + 4 <= m && seg[i + 3].t < t1; i += 4)
        for (int l = 0; l < 4; ++l) {
            const double s = seg[i + l].t - t0, v = seg[i + l].u - (x.p0 + s * (x.p1 + s * x.p2));
            lows[l] = v < lows[l] ? v : lows[l];
            highs[l] = v > highs[l] ? v : highs[l];
        }
    low = std::min(low, *std::min_element(lows, lows + 4));
    high = std::max(high, *std::max_element(highs, highs + 4));
    for (; i < m && seg[i].t < t1; ++i) {
        if (held && i > 0) see(seg[i].t - t0, seg[i - 1].u);
        see(seg[i].t - t0, seg[i].u);
    }
    if (i > 0) see(t1 - t0, seg[i - 1].u + seg[i - 1].s * (t1 - seg[i - 1].t));
    return std::max(-low, high);
}

double Input::slope(double t) const {
    return kind == 2 ? amplitude * TWO_PI / period * std::cos(TWO_PI * t / period + phase) : 0.0;
}

void Input::breaks(double t0, double t1, int most, std::vector<double>& out) const {
    if (!sampled()) return;
    const int first = segment(t0, -1) + 1;
    int last = first;
    while (last < static_cast<int>(seg.size()) && seg[last].t < t1) {
        if (++last - first > most) return;
    }
    for (int i = first; i < last; ++i)
        if (seg[i].t > t0) out.push_back(seg[i].t);
}

double Input::next_knot(double t, int hint) const {
    const int i = segment(t, hint) + 1;
    return i < static_cast<int>(seg.size()) ? seg[i].t : std::numeric_limits<double>::infinity();
}

void Cursor::enter(double t) {
    const auto& seg = in_->seg;
    from_ = t;
    s_ = seg_ < 0 ? 0.0 : seg[seg_].s;
    u_ = seg_ < 0 ? seg[0].u : seg[seg_].u + s_ * (t - seg[seg_].t);
    next_ = seg_ + 1 < static_cast<int>(seg.size()) ? seg[seg_ + 1].t : std::numeric_limits<double>::infinity();
}

void Cursor::begin(const Input* input, double t) {
    in_ = input;
    seg_ = input->segment(t, seg_);
    base_ = Integrals();
    enter(t);
    sum = base_;
    level_ = u_;
}

void Cursor::advance(double t) {
    const Input::Segment* seg = in_->seg.data();
    const int m = static_cast<int>(in_->seg.size());
    int k = seg_;
    double from = from_, next = next_, u = u_, s = s_;
    Integrals base = base_;
    while (next <= t) {
        const int jump = k + Input::BLOCK;
        if (k >= 0 && k % Input::BLOCK == 0 && jump < m && seg[jump].t <= t && from == seg[k].t) {
            const Integrals& b = in_->block[k / Input::BLOCK];
            base.append(seg[jump].t - from, b.i1, b.i2, b.i3);
            k = jump;
        } else {
            base.append_line(next - from, u, s);
            ++k;
        }
        from = seg[k].t;
        u = seg[k].u;
        s = seg[k].s;
        next = k + 1 < m ? seg[k + 1].t : std::numeric_limits<double>::infinity();
    }
    seg_ = k;
    from_ = from;
    next_ = next;
    u_ = u;
    s_ = s;
    base_ = base;
}

namespace {

struct Stand {
    int k;
    double from, next, u, s;
    Integrals base;
};

// As Cursor::move, to many times in registers: most often every time is a knot.
THERMID_CLONES void march(const Input::Segment* seg, const Integrals* block, int m, Stand& at, const double* t, int rows, double* sums, int stride) {
    Stand x = at;
    for (int r = 0; r < rows; ++r) {
        // From knot to knot as long as every time is the next one.
        const Input::Segment* g = seg + x.k + 1;
        const int most = std::min(rows - r, m - 2 - x.k);
        int run = 0;
        while (run < most && g[run].t == t[r + run]) ++run;
        for (const int last = r + run; r < last; ++r, ++g) {
            x.base.append_line(g->t - x.from, x.u, x.s);
            x.from = g->t;
            x.u = g->u;
            x.s = g->s;
            sums[r] = x.base.i1;
            sums[stride + r] = x.base.i2;
            sums[2 * stride + r] = x.base.i3;
        }
        x.k += run;
        if (run > 0) x.next = g->t;
        if (r == rows) break;
        while (x.next <= t[r]) {
            const int jump = x.k + Input::BLOCK;
            if (x.k >= 0 && x.k % Input::BLOCK == 0 && jump < m && seg[jump].t <= t[r] && x.from == seg[x.k].t) {
                const Integrals& b = block[x.k / Input::BLOCK];
                x.base.append(seg[jump].t - x.from, b.i1, b.i2, b.i3);
                x.k = jump;
            } else {
                x.base.append_line(x.next - x.from, x.u, x.s);
                ++x.k;
            }
            x.from = seg[x.k].t;
            x.u = seg[x.k].u;
            x.s = seg[x.k].s;
            x.next = x.k + 1 < m ? seg[x.k + 1].t : std::numeric_limits<double>::infinity();
        }
        Integrals here = x.base;
        if (t[r] != x.from) here.append_line(t[r] - x.from, x.u, x.s);
        sums[r] = here.i1;
        sums[stride + r] = here.i2;
        sums[2 * stride + r] = here.i3;
    }
    at = x;
}

}  // namespace

void Cursor::move(const double* t, int rows, double* sums, int stride) {
    Stand at{seg_, from_, next_, u_, s_, base_};
    march(in_->seg.data(), in_->block.data(), static_cast<int>(in_->seg.size()), at, t, rows, sums, stride);
    seg_ = at.k;
    from_ = at.from;
    next_ = at.next;
    u_ = at.u;
    s_ = at.s;
    base_ = at.base;
}

double StepInput::project(const Input& input, double t, double end, int& hint) {
    const double h = end - t;
    base = input.mean;
    const int i = hint = input.segment(t, hint);
    const int m = static_cast<int>(input.seg.size());
    p2 = 0.0;
    exact = i + 1 >= m || input.seg[i + 1].t >= end;
    variance = 0.0;
    if (exact) {
        p0 = i < 0 ? input.seg[0].u : input.seg[i].u + input.seg[i].s * (t - input.seg[i].t);
        p1 = i < 0 ? 0.0 : input.seg[i].s;
        return 0.0;
    }
    Cursor c;
    Integrals at[4];
    c.begin(&input, t);
    for (int k = 0; k < 4; ++k) {
        c.move(k == 3 ? end : t + 0.25 * (k + 1) * h);
        at[k] = c.sum;
    }
    // Legendre coefficients on [0, 1] from the moments of u, u (1 - x), u (1 - x)^2.
    const double e0 = at[3].i1 / h, e1 = at[3].i2 / (h * h), e2 = 2.0 * at[3].i3 / (h * h * h);
    const double a0 = e0, a1 = 3.0 * (e0 - 2.0 * e1), a2 = 5.0 * (e0 - 6.0 * e1 + 6.0 * e2);
    p0 = a0 - a1 + a2;
    p1 = (2.0 * a1 - 6.0 * a2) / h;
    p2 = 6.0 * a2 / (h * h);
    // What is left is orthogonal to the polynomial.
    variance = std::max(0.0, input.square(t, i, end, c.segment()) / h - a0 * a0 - a1 * a1 / 3.0 - a2 * a2 / 5.0);
    double worst = 0.0;
    for (int k = 0; k < 3; ++k) worst = std::max(worst, std::fabs(www(0.25 * (k + 1) * h, at[k])));
    return worst;
}

}  // namespace thermid
