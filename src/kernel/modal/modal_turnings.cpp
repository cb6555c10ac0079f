// Turning points of the modal solution. Between two knots of the inputs a temperature is a sum of exponentials, a straight line and waves;
// its slope is looked at where stretches end and, after a knot, at a quarter of the stretch, a sixteenth and so on, down to the fastest mode.
#include <algorithm>
#include <cmath>

#include "modal/modal.hpp"

namespace thermid {

namespace {
constexpr double START = 0.01, CALM = 0.1;  // of the shortest time constant: rows are no further apart, just after a kink and long after
constexpr double PARTS = 30.0;  // of a piece between two knots: with more, it is no part of a calm span
constexpr double SHORT = 0.1;  // of the shortest time constant: a slope changes sign once at most
constexpr double CLOSE = 1e-9; // of a stretch: where its slope is zero
}  // namespace

// Shares of modes, inputs and waves in every column: the observed nodes, then the sums.
void Modal::follow(const double* out_t, long nout, const int* obs, int nobs, const Sums& sums, double t0) {
    const int ns = modes_, nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size()), columns = nobs + sums.size();
    turnings_.begin(columns, out_t, nout);
    course_shape_.assign(static_cast<size_t>(columns) * ns, 0.0);
    course_base_.assign(columns, 0.0);
    course_direct_.assign(static_cast<size_t>(columns) * nin, 0.0);
    course_wave_.assign(static_cast<size_t>(columns) * 2 * nw, 0.0);
    auto add = [&](int c, int i, double weight) {
        for (int j = 0; j < ns; ++j) course_shape_[c * ns + j] += weight * shape_[i * ns + j];
        course_base_[c] += weight * (ref_ + direct_[i * cols_]);
        for (int k = 0; k < nin; ++k) course_direct_[c * nin + k] += weight * direct_[i * cols_ + 1 + sampled_[k]];
        for (int k = 0; k < nw; ++k) {
            double* to = course_wave_.data() + 2 * (c * nw + k);
            to[0] += weight * direct_[i * cols_ + 1 + sines_[k]] * p_.inputs[sines_[k]].amplitude;
            for (int j = 0; j < ns; ++j) {
                to[0] += weight * shape_[i * ns + j] * wave_s_[j * nw + k];
                to[1] += weight * shape_[i * ns + j] * wave_c_[j * nw + k];
            }
        }
    };
    for (int c = 0; c < nobs; ++c) add(c, obs[c], 1.0);
    for (int c = 0; c < sums.size(); ++c)
        for (int k = sums.begin[c]; k < sums.begin[c + 1]; ++k) add(nobs + c, sums.node[k], sums.weight[k]);
    fastest_ = ns > 0 ? *std::max_element(rate_.begin(), rate_.begin() + ns) : 0.0;
    kink_ = t0;
    for (auto* v : {&level_, &tilt_, &reached_}) v->assign(ns, 0.0);
    for (auto& v : slope_) v.assign(columns, 0.0);
    wave_now_.assign(2 * nw, 0.0);
}

// Where the run is calm. Over rows D apart a column strays from the straight line between them by b (u_max - u_min) D / 4 at most, where b is
// what an input does to its slope, and by what it takes from the input at once; modes that a kink has left alone by (rate D)^2 / 8.
void Modal::survey(double t0, double t_end) {
    const int ns = modes_, nin = static_cast<int>(sampled_.size()), columns = static_cast<int>(course_base_.size());
    spans_.assign(1, {t_end, true});
    row_times_.clear();
    if (!sines_.empty() || nin == 0 || ns == 0) return;
    std::vector<double> rate(nin, 0.0), direct(nin, 0.0), low(nin), high(nin), bottom(nin), top(nin), to(nin), knots;
    for (int k = 0; k < nin; ++k) {
        const Input& in = p_.inputs[sampled_[k]];
        for (int c = 0; c < columns; ++c) {
            double b = 0.0;
            for (int j = 0; j < ns; ++j) b += course_shape_[c * ns + j] * force_[j * cols_ + 1 + sampled_[k]];
            rate[k] = std::max(rate[k], std::fabs(b));
            direct[k] = std::max(direct[k], std::fabs(course_direct_[c * nin + k]));
        }
        double jump = 0.0;
        for (size_t i = 1; in.kind == SAMPLED_HOLD && i < in.seg.size(); ++i) jump = std::max(jump, std::fabs(in.seg[i].u - in.seg[i - 1].u));
        if (direct[k] * jump > Turnings::NOISE) return;
        in.knots(t0, t_end, knots);
    }
    if (knots.empty() || (t_end - t0) / static_cast<double>(knots.size()) * fastest_ > CALM) return;
    if (nin > 1) {
        std::sort(knots.begin(), knots.end());
        knots.erase(std::unique(knots.begin(), knots.end()), knots.end());
    }
    knots.push_back(t_end);
    spans_.clear();
    const auto mark = [&](double end, bool exact) {
        if (!spans_.empty() && spans_.back().exact == exact) spans_.back().end = end;
        else spans_.push_back({end, exact});
    };
    const auto spacing = [&](double since) { return std::min(START * std::exp(std::min(fastest_ * since / 3.0, 30.0)), CALM) / fastest_; };
    std::vector<int> at(nin, -1);
    double begin = t0, kink = t0, longest = spacing(0.0), t = t0;
    bool empty = true;
    for (double next : knots) {
        // The piece from t to next: least and greatest of every input.
        double alone = 0.0, joined = 0.0, jump = 0.0;
        for (int k = 0; k < nin; ++k) {
            const Input& in = p_.inputs[sampled_[k]];
            const int i = at[k] = in.segment(t, at[k]);
            const double u = i < 0 ? in.seg[0].u : in.seg[i].u + in.seg[i].s * (t - in.seg[i].t), v = i < 0 ? u : u + in.seg[i].s * (next - t);
            jump += t > t0 ? rate[k] * std::fabs(u - to[k]) : 0.0;
            to[k] = v;
            bottom[k] = std::min(u, v);
            top[k] = std::max(u, v);
            alone += (top[k] - bottom[k]) * (0.25 * rate[k] * (next - t) + direct[k]);
            low[k] = empty ? bottom[k] : std::min(low[k], bottom[k]);
            high[k] = empty ? top[k] : std::max(high[k], top[k]);
            joined += (high[k] - low[k]) * (0.25 * rate[k] * (next - begin) + direct[k]);
        }
        const bool bent = jump * CALM * CALM > 2.0 * fastest_ * Turnings::NOISE;
        if (bent) kink = t;
        if (bent || !(joined <= Turnings::NOISE && next - begin <= longest)) {  // a row at t
            if (!empty) {
                row_times_.push_back(t);
                mark(t, false);
            }
            longest = spacing(t - kink);
            begin = t;
            low = bottom;
            high = top;
            const double parts = std::ceil((next - t) / longest);
            empty = !(alone <= Turnings::NOISE && parts <= PARTS);
            for (double q = 1.0; !empty && q < parts; ++q) row_times_.push_back(begin = t + (next - t) * q / parts);
            if (empty) {
                row_times_.push_back(next);
                mark(next, true);
                if (alone > Turnings::NOISE) kink = next;
                begin = next;
                longest = spacing(next - kink);
            }
        } else {
            empty = false;
        }
        t = next;
    }
    if (empty) return;
    row_times_.push_back(t_end);
    mark(t_end, false);
}

// Rows among the outputs, and all columns as combinations of what a row holds: modes, one, sampled inputs, waves.
void Modal::weave(const double* out_t, long nout) {
    const int ns = modes_, nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size()), columns = static_cast<int>(course_base_.size());
    std::vector<double> all(out_t, out_t + nout);
    all.insert(all.end(), row_times_.begin(), row_times_.end());
    std::inplace_merge(all.begin(), all.begin() + nout, all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    row_times_.swap(all);
    stored_.assign(row_times_.size(), -1);
    for (size_t r = 0, next = 0; r < row_times_.size() && next < static_cast<size_t>(nout); ++r)
        if (row_times_[r] == out_t[next]) stored_[r] = static_cast<long>(next++);
    echo_ = std::any_of(course_direct_.begin(), course_direct_.end(), [](double x) { return x != 0.0; });
    terms_ = lanes_ + 1 + (echo_ ? nin : 0) + 2 * nw;
    const size_t wide = padded(columns);
    mix_.assign(static_cast<size_t>(terms_) * wide + 4, 0.0);
    for (int c = 0; c < columns; ++c) {
        double* to = mix_.data() + c;
        for (int j = 0; j < ns; ++j) to[j * wide] = course_shape_[c * ns + j];
        to += lanes_ * wide;
        *to = course_base_[c];
        to += wide;
        for (int k = 0; echo_ && k < nin; ++k, to += wide) *to = course_direct_[c * nin + k];
        for (int k = 0; k < 2 * nw; ++k, to += wide) *to = course_wave_[c * 2 * nw + k];
    }
    rows_.assign(static_cast<size_t>(BLOCK) * terms_, 0.0);
    for (int r = 0; r < BLOCK; ++r) rows_[static_cast<size_t>(r) * terms_ + lanes_] = 1.0;
    seen_.resize(static_cast<size_t>(BLOCK) * columns);
}

// The rows that wait: outputs are stored, and along a calm span all are shown.
void Modal::collect(int nobs, double* traces) {
    const int columns = static_cast<int>(course_base_.size());
    blend(seen_.data(), rows_.data(), filled_, mix_.data(), terms_, columns);
    for (int r = 0; r < filled_; ++r)
        if (stored_[done_ + r] >= 0) std::copy_n(seen_.data() + r * columns, nobs, traces + stored_[done_ + r] * nobs);
    if (exact_) return;
    const auto output = [&](int r) { return stored_[done_ + r] >= 0; };
    for (int first = 0, last; first < filled_; first = last) {  // but for outputs among outputs, between which nothing happens
        while (first + 1 < filled_ && output(first) && output(first + 1)) ++first;
        for (last = first + 1; last < filled_ && !(output(last - 1) && output(last));) ++last;
        turnings_.see_rows(row_times_.data() + done_ + first, last - first, seen_.data() + first * columns);
    }
}

void Modal::parts_of(Stretch& x) const {
    if (!x.parts.empty()) return;
    double s = x.h;
    do {
        s *= 0.25;
        std::vector<Phi> own;
        for (int j = 0; j < modes_; ++j) own.push_back(phi(rate_[j] * s));
        x.parts.push_back(std::move(own));
    } while (fastest_ * s > SHORT);
}

// Sines and cosines of the inputs that are waves, at a time.
void Modal::waves_at(double time) {
    for (size_t k = 0; k < sines_.size(); ++k) {
        wave_now_[2 * k] = wave(static_cast<int>(k), time, true);
        wave_now_[2 * k + 1] = wave(static_cast<int>(k), time, false);
    }
}

// A column at s from the start of a stretch, where the states are z and inputs, by value and slope, are `drive` at its start; after waves_at.
double Modal::course(int column, const double* z, const double* drive, double s) const {
    const int nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size());
    double y = course_base_[column];
    for (int j = 0; j < modes_; ++j) y += course_shape_[column * modes_ + j] * z[j];
    for (int k = 0; k < nin; ++k) y += course_direct_[column * nin + k] * (drive[2 * k] + s * drive[2 * k + 1]);
    for (int k = 0; k < nw; ++k) {
        const double* w = course_wave_.data() + 2 * (column * nw + k);
        y += w[0] * wave_now_[2 * k] + w[1] * wave_now_[2 * k + 1];
    }
    return y;
}

// Its slope: z' = -rate z + force.
double Modal::course_slope(int column, const double* z, const double* drive, double s) const {
    const int nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size());
    double y = 0.0;
    for (int j = 0; j < modes_; ++j) y += course_shape_[column * modes_ + j] * (level_[j] + s * tilt_[j] - rate_[j] * z[j]);
    for (int k = 0; k < nin; ++k) y += course_direct_[column * nin + k] * drive[2 * k + 1];
    for (int k = 0; k < nw; ++k) {
        const double *w = course_wave_.data() + 2 * (column * nw + k), omega = 2.0 * 3.14159265358979323846 / p_.inputs[sines_[k]].period;
        y += omega * (w[0] * wave_now_[2 * k + 1] - w[1] * wave_now_[2 * k]);
    }
    return y;
}

double Modal::slope_at(int column, const double* drive, double s, double t) {
    for (int j = 0; j < modes_; ++j) {
        const Phi f = phi(rate_[j] * s);
        reached_[j] = f.e * before_[j] + s * (f.p1 * level_[j] + s * f.p2 * tilt_[j]);
    }
    waves_at(t + s);
    return course_slope(column, reached_.data(), drive, s);
}

// One stretch that has been carried out, from t to `until`: states before_ at its start, z_ at its end.
void Modal::turn(Stretch& x, const double* drive, double t, double until) {
    const int columns = static_cast<int>(course_base_.size()), nin = static_cast<int>(sampled_.size());
    if (!(x.h > 0.0)) return;
    for (int j = 0; j < modes_; ++j) {
        level_[j] = force_[j * cols_];
        tilt_[j] = 0.0;
        for (int k = 0; k < nin; ++k) {
            level_[j] += force_[j * cols_ + 1 + sampled_[k]] * drive[2 * k];
            tilt_[j] += force_[j * cols_ + 1 + sampled_[k]] * drive[2 * k + 1];
        }
    }
    // From the end to the start: the parts that the fastest mode, and the time since the last knot, ask for.
    const double least = std::max(fastest_ > 0.0 ? SHORT / fastest_ : x.h, 0.3 * (t - kink_));
    int many = 0;
    if (0.25 * x.h > least || t == kink_) {
        parts_of(x);
        for (double s = 0.25 * x.h; many < static_cast<int>(x.parts.size()) && (many == 0 || s > 0.25 * least); s *= 0.25) ++many;
    }
    if (t == kink_) {  // elsewhere values and slopes are those at the end of the last stretch
        waves_at(t);
        for (int c = 0; c < columns; ++c) {
            slope_[0][c] = course_slope(c, before_.data(), drive, 0.0);
            turnings_.see(c, t, course(c, before_.data(), drive, 0.0));
        }
    }
    double from = 0.0;
    for (int k = many; k >= 0; --k) {
        const double to = k == 0 ? x.h : x.h * std::pow(0.25, k);
        const double* z = z_.data();
        if (k > 0) {
            const std::vector<Phi>& own = x.parts[k - 1];
            for (int j = 0; j < modes_; ++j) reached_[j] = own[j].e * before_[j] + to * (own[j].p1 * level_[j] + to * own[j].p2 * tilt_[j]);
            z = reached_.data();
        }
        waves_at(t + to);
        for (int c = 0; c < columns; ++c) slope_[1][c] = course_slope(c, z, drive, to);
        for (int c = 0; c < columns; ++c) {
            if (!(slope_[0][c] * slope_[1][c] < 0.0) || (std::fabs(slope_[0][c]) + std::fabs(slope_[1][c])) * (to - from) < 1e-6) continue;
            const auto f = [&](double s) { return slope_at(c, drive, s, t); };
            const double s = Turnings::root(f, from, slope_[0][c], to, slope_[1][c], CLOSE * x.h);
            f(s);
            turnings_.see(c, t + s, course(c, reached_.data(), drive, s));
        }
        slope_[0].swap(slope_[1]);
        from = to;
    }
    waves_at(until);
    for (int c = 0; c < columns; ++c) turnings_.see(c, until, course(c, z_.data(), drive, x.h));
}

}  // namespace thermid
