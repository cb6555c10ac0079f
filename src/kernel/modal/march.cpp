// The modes carried from knot to knot of the inputs and from output to output.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "algebra/four.hpp"
#include "modal/modal.hpp"

namespace thermid {

namespace {

constexpr double ROUNDING = 4.0 * std::numeric_limits<double>::epsilon();

inline const Four& four(const double* x) { return *reinterpret_cast<const Four*>(x); }
inline void put(double* to, const Four& x) { std::memcpy(to, &x, sizeof x); }

// Stretches of one length, one after the other: z = e z + c + sum_k (a_k u_k + b_k s_k), where `step` holds e, c, a_1, b_1, ... in lanes.
// Rows that are asked for are written; sum is that of the states at the starts.
THERMID_CLONES void carry(const double* step, int lanes, const double* drive, int width, int count, const int* row, double* rows, int terms,
                          double* z, double* sum) {
    int j = 0;
    if (width == 2)  // one sampled input, as most have: twelve modes with everything in registers
        for (; j + 12 <= lanes; j += 12) {
            const double *s = step + j, *d = drive;
            const Four e0 = four(s), e1 = four(s + 4), e2 = four(s + 8), c0 = four(s + lanes), c1 = four(s + lanes + 4), c2 = four(s + lanes + 8);
            const Four a0 = four(s + 2 * lanes), a1 = four(s + 2 * lanes + 4), a2 = four(s + 2 * lanes + 8);
            const Four b0 = four(s + 3 * lanes), b1 = four(s + 3 * lanes + 4), b2 = four(s + 3 * lanes + 8);
            Four z0 = four(z + j), z1 = four(z + j + 4), z2 = four(z + j + 8), t0 = {}, t1 = {}, t2 = {};
            for (int p = 0; p < count; ++p, d += 2) {
                t0 += z0;
                t1 += z1;
                t2 += z2;
                z0 = e0 * z0 + (d[0] * a0 + (d[1] * b0 + c0));
                z1 = e1 * z1 + (d[0] * a1 + (d[1] * b1 + c1));
                z2 = e2 * z2 + (d[0] * a2 + (d[1] * b2 + c2));
                if (row[p] < 0) continue;
                double* to = rows + static_cast<size_t>(row[p]) * terms + j;
                put(to, z0);
                put(to + 4, z1);
                put(to + 8, z2);
            }
            put(z + j, z0);
            put(z + j + 4, z1);
            put(z + j + 8, z2);
            put(sum + j, t0);
            put(sum + j + 4, t1);
            put(sum + j + 8, t2);
        }
    for (; j < lanes; j += 4) {
        const double *s = step + j, *d = drive;
        const Four e = four(s), c = four(s + lanes);
        Four x = four(z + j), total = {};
        for (int p = 0; p < count; ++p, d += width) {
            Four f = c;
            const double* a = s + 2 * lanes;
            for (int k = 0; k < width; ++k, a += lanes) f += d[k] * four(a);
            total += x;
            x = e * x + f;
            if (row[p] >= 0) put(rows + static_cast<size_t>(row[p]) * terms + j, x);
        }
        put(z + j, x);
        put(sum + j, total);
    }
}

// Whether every temperature is a number between 0 and 1e5 K.
THERMID_CLONES bool plausible(const double* t, size_t n) {
    int64_t bad = 0;
    for (size_t i = 0; i < n; ++i) bad += !(t[i] > COLDEST) | !(t[i] < 1e5);
    return bad == 0;
}

}  // namespace

namespace {

// A sampled input from its last knot on.
struct Follower {
    const Input::Segment *next, *end;
    double knot, from, u, slope, now;

    void enter() {
        from = next->t;
        u = next->u;
        slope = next->s;
        knot = ++next == end ? std::numeric_limits<double>::infinity() : next->t;
    }
};

// The short way along a log: how many knots in a row come h after one another, up to the first output that lies on none of them. Fills values,
// slopes and the rows of outputs.
// `echo`: where rows hold the input, that of the row to come; `terms` apart.
int regular(Follower& f, const double* out_t, long nout, long& next, int most, double t, double h, double* drive, int* row, int& filled,
            double* echo, int terms) {
    const Input::Segment* s = f.next;
    most = static_cast<int>(std::min<std::ptrdiff_t>(most, f.end - s));
    double now = f.now, slope = f.slope;
    int k = 0;
    for (; k < most && next < nout; ++k, ++s) {
        const double at = s->t, slack = ROUNDING * std::fabs(at);
        const bool out = at == out_t[next];
        if (!(out || at + slack < out_t[next]) || !(std::fabs(at - t - h) <= slack)) break;
        *drive++ = now;
        *drive++ = slope;
        row[k] = out ? filled : -1;
        if (echo && out) echo[static_cast<size_t>(filled) * terms] = s->u;
        filled += out;
        next += out;
        t = at;
        now = s->u;
        slope = s->s;
    }
    if (k == 0) return 0;
    f.next = s - 1;
    f.enter();
    f.now = f.u;
    return k;
}

}  // namespace

// Which combination of a row (modes, one, sampled inputs, waves) every observed temperature is.
void Modal::outputs(const int* obs, int nobs) {
    const int ns = modes_, nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size()), wide = padded(nobs);
    echo_ = false;
    for (int o = 0; o < nobs; ++o)
        for (int k : sampled_) echo_ = echo_ || direct_[obs[o] * cols_ + 1 + k] != 0.0;
    terms_ = lanes_ + 1 + (echo_ ? nin : 0) + 2 * nw;
    mix_.assign(static_cast<size_t>(terms_) * wide + 4, 0.0);
    for (int o = 0; o < nobs; ++o) {
        const int i = obs[o];
        double* to = mix_.data() + o;
        for (int j = 0; j < ns; ++j) to[static_cast<size_t>(j) * wide] = shape_[i * ns + j];
        to += static_cast<size_t>(lanes_) * wide;
        *to = ref_ + direct_[i * cols_];
        to += wide;
        for (size_t k = 0; echo_ && k < sampled_.size(); ++k) {
            *to = direct_[i * cols_ + 1 + sampled_[k]];
            to += wide;
        }
        for (int k = 0; k < nw; ++k, to += 2 * wide) {
            to[0] = direct_[i * cols_ + 1 + sines_[k]] * p_.inputs[sines_[k]].amplitude;
            for (int j = 0; j < ns; ++j) {
                to[0] += shape_[i * ns + j] * wave_s_[j * nw + k];
                to[wide] += shape_[i * ns + j] * wave_c_[j * nw + k];
            }
        }
    }
    stretches_.assign(256, Stretch());
    rows_.assign(static_cast<size_t>(BLOCK) * terms_, 0.0);
    for (int r = 0; r < BLOCK; ++r) rows_[static_cast<size_t>(r) * terms_ + lanes_] = 1.0;
    drive_.assign(static_cast<size_t>(BLOCK) * 2 * nin, 0.0);
    sum_.assign(lanes_, 0.0);
}

// The factors of a stretch of length h that ends at a time: those of a stretch met before where lengths differ by no more than the
// rounding of times. What waits is carried out before factors are replaced.
Modal::Stretch& Modal::stretch(double h, double until, int nobs, double* traces) {
    uint64_t bits;
    std::memcpy(&bits, &h, sizeof bits);
    bits = (bits + (uint64_t(1) << 20)) >> 21;
    Stretch& x = stretches_[(bits * 0x9E3779B97F4A7C15u) >> 56];
    if (x.h >= 0.0 && std::fabs(x.h - h) <= ROUNDING * std::fabs(until)) return x;
    flush(nobs, traces);
    const int nin = static_cast<int>(sampled_.size());
    x.h = h;
    x.parts.clear();
    x.step.assign(static_cast<size_t>(lanes_) * (2 + 2 * nin), 0.0);
    x.whole.assign(static_cast<size_t>(lanes_) * 3, 0.0);
    for (int j = 0; j < modes_; ++j) {
        const Phi f = phi(rate_[j] * h);
        x.step[j] = f.e;
        x.step[lanes_ + j] = h * f.p1 * force_[j * cols_];
        for (int k = 0; k < nin; ++k) {
            x.step[(2 + 2 * k) * lanes_ + j] = h * f.p1 * force_[j * cols_ + 1 + sampled_[k]];
            x.step[(3 + 2 * k) * lanes_ + j] = h * h * f.p2 * force_[j * cols_ + 1 + sampled_[k]];
        }
        x.whole[j] = h * f.p1;
        x.whole[lanes_ + j] = h * h * f.p2;
        x.whole[2 * lanes_ + j] = h * h * h * f.p3;
    }
    return x;
}

// Carries out the stretches that wait, adds up their integrals and writes their outputs.
void Modal::flush(int nobs, double* traces) {
    const int nin = static_cast<int>(sampled_.size());
    if (count_ == 0) return;
    std::vector<double> sums(2 * nin + 1);
    for (int p = 0, q = 0; p < count_; p = q) {
        const Stretch& x = *use_[p];
        while (q < count_ && use_[q] == &x) ++q;
        const double* drive = drive_.data() + static_cast<size_t>(p) * 2 * nin;
        carry(x.step.data(), lanes_, drive, 2 * nin, q - p, row_ + p, rows_.data(), terms_, z_.data(), sum_.data());
        std::fill(sums.begin(), sums.end(), 0.0);
        for (int i = p; i < q; ++i)
            for (int k = 0; k < 2 * nin; ++k) sums[k] += drive[(i - p) * 2 * nin + k];
        for (int k = 0; k < nin; ++k) area_[1 + sampled_[k]] += x.h * (sums[2 * k] + 0.5 * x.h * sums[2 * k + 1]);
        const double *w = x.whole.data(), *w2 = w + lanes_, *w3 = w2 + lanes_;
        for (int j = 0; j < modes_; ++j) {
            double level = (q - p) * force_[j * cols_], slope = 0.0;
            for (int k = 0; k < nin; ++k) {
                level += force_[j * cols_ + 1 + sampled_[k]] * sums[2 * k];
                slope += force_[j * cols_ + 1 + sampled_[k]] * sums[2 * k + 1];
            }
            total_[j] += w[j] * sum_[j] + w2[j] * level + w3[j] * slope;
        }
    }
    if (filled_ > 0 && turnings_.on()) {
        collect(nobs, traces);
        sane_ = sane_ && plausible(seen_.data(), static_cast<size_t>(filled_) * course_base_.size());
    } else if (filled_ > 0) {
        double* to = traces + static_cast<size_t>(done_) * nobs;
        blend(to, rows_.data(), filled_, mix_.data(), terms_, nobs);
        sane_ = sane_ && plausible(to, static_cast<size_t>(filled_) * nobs);
    }
    done_ += filled_;
    count_ = filled_ = 0;
}

void Modal::march(const double* outputs, long noutputs, const int* obs, int nobs, double t0, double t_end, const std::function<void()>& poll, Result& r) {
    const bool watch = turnings_.on();  // then with rows among the outputs
    const double* out_t = watch ? row_times_.data() : outputs;
    const long nout = watch ? static_cast<long>(row_times_.size()) : noutputs;
    const int nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size());
    constexpr double INF = std::numeric_limits<double>::infinity();
    std::vector<Follower> follow(nin);
    for (int k = 0; k < nin; ++k) {
        const auto& seg = p_.inputs[sampled_[k]].seg;
        Follower& f = follow[k];
        f = {seg.data(), seg.data() + seg.size(), seg[0].t, t0, seg[0].u, 0.0, seg[0].u};  // level before the first knot
        while (f.knot <= t0) f.enter();
        f.now = f.u + f.slope * (t0 - f.from);
    }
    double t = t0, wanted = nout > 0 ? out_t[0] : INF;
    Stretch* last = stretches_.data();
    long next = 0, steps = 0;
    const auto show = [&](double time) {  // what outputs at a time take from inputs directly
        double* to = rows_.data() + static_cast<size_t>(filled_++) * terms_ + lanes_ + 1;
        if (echo_)
            for (const Follower& f : follow) *to++ = f.now;
        for (int k = 0; k < nw; ++k) {
            *to++ = wave(k, time, true);
            *to++ = wave(k, time, false);
        }
    };
    const bool plain = nin == 1 && nw == 0 && (!echo_ || watch);
    double* const echo = echo_ ? rows_.data() + lanes_ + 1 : nullptr;
    size_t span = 0;
    long until_row = nout;  // rows of the calm span under way
    const auto enter_span = [&] {  // where t has reached the next
        while (span + 1 < spans_.size() && spans_[span].end <= t + ROUNDING * std::fabs(t)) ++span;
        const bool exact = spans_[span].exact;
        if (exact != exact_) {
            flush(nobs, r.traces);
            kink_ = t;
        }
        exact_ = exact;
        until_row = std::upper_bound(out_t, out_t + nout, spans_[span].end) - out_t;
    };
    if (watch) {
        exact_ = spans_[0].exact;
        enter_span();
    }
    for (; next < nout || t < t_end; ++steps) {
        if (watch && span + 1 < spans_.size() && spans_[span].end <= t + ROUNDING * std::fabs(t)) enter_span();
        if (plain && last->h > 0.0 && !(watch && exact_)) {
            double* drive = drive_.data() + 2 * static_cast<size_t>(count_);
            const int k = regular(follow[0], out_t, until_row, next, BLOCK - count_, t, last->h, drive, row_ + count_, filled_, echo, terms_);
            if (k > 0) t = follow[0].from;
            std::fill(use_ + count_, use_ + count_ + k, last);
            count_ += k;
            steps += k;
            wanted = next < nout ? out_t[next] : INF;
            if (next == nout && !(t < t_end)) break;
            if (next == until_row && next < nout && k > 0) {  // the next span
                --steps;
                continue;
            }
        }
        double until = std::min(wanted, t_end);
        for (const Follower& f : follow) until = std::min(until, f.knot);
        for (int k = 0; watch && exact_ && k < nw; ++k) until = std::min(until, t + 0.125 * p_.inputs[sines_[k]].period);
        until = std::max(until, t);
        if (count_ == BLOCK) {
            flush(nobs, r.traces);
            if (steps / BLOCK % 64 == 0 && poll) poll();
        }
        const double h = until - t, slack = ROUNDING * std::fabs(until), same = until + slack;
        if (!(last->h >= 0.0 && std::fabs(last->h - h) <= slack)) last = &stretch(h, until, nobs, r.traces);
        const int at = count_++;
        use_[at] = last;
        double* drive = drive_.data() + static_cast<size_t>(at) * 2 * nin;
        // Times that differ by rounding only are one time.
        for (Follower& f : follow) {
            *drive++ = f.now;
            *drive++ = f.slope;
            while (f.knot <= same) f.enter();
            f.now = f.u + f.slope * (until - f.from);
        }
        row_[at] = -1;
        if (watch && exact_) {  // one stretch after the other
            before_ = z_;
            const std::vector<double> own(drive_.begin(), drive_.begin() + 2 * nin);
            row_[at] = wanted <= same ? filled_ : -1;
            if (row_[at] >= 0) {
                show(until);
                wanted = ++next < nout ? out_t[next] : INF;
            }
            flush(nobs, r.traces);
            turn(*last, own.data(), t, until);
            for (const Follower& f : follow)
                if (f.from > t && f.from <= same) kink_ = until;
            t = until;
            continue;
        }
        t = until;
        if (!(wanted <= same)) continue;
        row_[at] = filled_;
        show(t);
        wanted = ++next < nout ? out_t[next] : INF;
    }
    r.steps = steps;
    flush(nobs, r.traces);
    r.filled = noutputs;
    for (size_t i = 0, n = sane_ ? 0 : static_cast<size_t>(noutputs) * nobs; i < n; ++i) {
        if (r.traces[i] > COLDEST && r.traces[i] < 1e5) continue;
        r.time = outputs[i / nobs];
        if (!std::isfinite(r.traces[i])) throw Failure{NON_FINITE, obs[i % nobs]};
        throw beyond(p_, obs[i % nobs], r.traces[i]);
    }
    r.time = t_end;
}

}  // namespace thermid
