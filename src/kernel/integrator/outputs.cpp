// Outputs inside an accepted step. Every number is a short row of weights (powers of time in the step, integrals of the inputs' left-over)
// times what the step knows of a node; many outputs are one matrix product. They are stored, or collected as least squares.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "algebra/four.hpp"
#include "integrator/outputs.hpp"
#include "algebra/traces.hpp"

namespace thermid {

Outputs::Outputs(Setup& setup, State& state, Step& step, Slaved& slaved, Errors& errors, Stages& stages)
    : view(setup.p, setup.coef), setup_(setup), state_(state), step_(step), slaved_(slaved), errors_(errors), stages_(stages), p_(setup.p), coef_(setup.coef), d_(setup.d),
      o_(setup.o), squares_(setup.squares), n_(setup.n), np_(setup.np), nk_(setup.nk), poly_(POWERS * static_cast<size_t>(n_), 0.0), unit_(nk_, 0.0),
      cursor_(nk_), unseen_(nk_, 0) {
    for (auto* v : {&g_, &dir_, &bb_}) v->assign(n_, 0.0);
    for (auto* v : {&SO_, &dirS_}) v->assign(static_cast<size_t>(n_) * np_, 0.0);
}

// Outputs at the start: a step of no length.
void Outputs::begin() {
    std::copy(state_.T.begin(), state_.T.end(), poly_.begin());
    for (int k = 0; k < nk_; ++k)
        if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], state_.t);
}

// Weights of m outputs at increasing times into shares_; the first slope_count_ terms are those of the sensitivities.
void Outputs::weigh(const double* times, int m) {
    double s[CHUNK], sums[3 * CHUNK], beyond[2 * CHUNK];
    shares_.resize((POWERS + 4 * static_cast<size_t>(nk_)) * CHUNK);
    powers(shares_.data(), s, times, state_.t, step_.end, step_.h, m);
    if (s[0] < at_) move_cursors(s[0], times[0]);
    double *w = shares_.data() + POWERS * CHUNK, *more = shares_.data() + static_cast<size_t>(slope_count_) * CHUNK;
    for (int k = 0; k < nk_; ++k) {
        if (!step_.noise[k].active) continue;
        cursor_[k].move(times, m, sums, CHUNK);
        left_over(w, more, s, sums, step_.in[k], m);
        w += 2 * CHUNK;
        more += 2 * CHUNK;
    }
    idle_shares_.resize(2 * CHUNK * setup_.idle.size());
    for (size_t i = 0; step_.leftover && i < setup_.idle.size(); ++i) {
        const int k = setup_.idle[i].input;
        double* to = idle_shares_.data() + 2 * CHUNK * i;
        if (step_.in[k].exact) continue;
        if (i > 0 && setup_.idle[i - 1].input == k) {
            std::copy(to - 2 * CHUNK, to, to);
            continue;
        }
        cursor_[k].move(times, m, sums, CHUNK);
        left_over(to, beyond, s, sums, step_.in[k], m);
    }
    at_ = s[m - 1];
}

// What idle inputs add to the sensitivities S (m, nodes, np) of the outputs that were weighed: each to the column of its parameter.
void Outputs::add_idle(double* S, int m, const int* obs, int nobs) const {
    for (size_t i = 0; step_.leftover && i < setup_.idle.size(); ++i) {
        if (step_.in[setup_.idle[i].input].exact) continue;
        const double *b = step_.idle_b.data() + i * n_, *ab = step_.idle_ab.data() + i * n_, *w = idle_shares_.data() + 2 * CHUNK * i;
        for (int j = 0; j < nobs; ++j) {
            if (obs[j] >= n_ || (b[obs[j]] == 0.0 && ab[obs[j]] == 0.0)) continue;
            double* to = S + j * static_cast<size_t>(np_) + setup_.idle[i].name;
            for (int r = 0; r < m; ++r, to += static_cast<size_t>(nobs) * np_) *to += w[r] * b[obs[j]] + w[CHUNK + r] * ab[obs[j]];
        }
    }
}

// What the weights of temperatures stand before: (terms, nodes).
void Outputs::temperature_terms(const int* obs, int nobs) {
    const size_t stride = padded(nobs);
    terms_.resize((POWERS + 4 * static_cast<size_t>(nk_)) * stride);
    double* to = terms_.data();
    auto add = [&](const double* v) {
        for (int j = 0; j < nobs; ++j) to[j] = v[obs[j]];
        to += stride;
    };
    for (int m = 0; m < POWERS; ++m) add(poly_.data() + m * static_cast<size_t>(n_));
    for (const Noise& z : step_.noise)
        if (z.active)
            for (const auto* v : {&z.b, &z.c}) add(v->data());
    for (const Noise& z : step_.noise)
        if (z.active)
            for (const auto* v : {&z.db, &z.aab}) add(v->data());
}

namespace {

// Values, first and second derivatives at both ends of a step.
struct Ends { const double *y0, *y1, *d0, *d1, *e0, *e1; };

// Coefficients of one column, or of four side by side.
template <class V>
THERMID_INLINE void quintic_of(double* c, size_t stride, const Ends& x, double h, int q) {
    V y0, y, a, b, p, z;
    const auto get = [q](V& v, const double* from) { std::memcpy(&v, from + q, sizeof v); };
    get(y0, x.y0);
    get(y, x.y1);
    get(a, x.d0);
    get(b, x.d1);
    get(p, x.e0);
    get(z, x.e1);
    y = y - y0;
    a = h * a;
    b = h * b;
    p = 0.5 * h * h * p;
    z = 0.5 * h * h * z;
    const auto put = [c, stride, q](int k, const V& v) { std::memcpy(c + k * stride + q, &v, sizeof v); };
    put(0, y0);
    put(1, a);
    put(2, p);
    put(3, 10.0 * y - 6.0 * a - 4.0 * b - 3.0 * p + z);
    put(4, 8.0 * a - 15.0 * y + 7.0 * b + 3.0 * p - 2.0 * z);
    put(5, 6.0 * y - 3.0 * (a + b) - p + z);
}

THERMID_CLONES void quintic(double* c, size_t stride, const Ends x, double h, int m) {
    int q = 0;
    for (; q + 4 <= m; q += 4) quintic_of<Four>(c, stride, x, h, q);
    for (; q < m; ++q) quintic_of<double>(c, stride, x, h, q);
}

THERMID_CLONES void cubic(double* c, size_t stride, const Ends x, double h, int m) {
    for (int q = 0; q < m; ++q) {
        const double y = x.y1[q] - x.y0[q], a = h * x.d0[q], b = h * x.d1[q];
        c[q] = x.y0[q];
        c[stride + q] = a;
        c[2 * stride + q] = 3.0 * y - 2.0 * a - b;
        c[3 * stride + q] = a + b - 2.0 * y;
        c[4 * stride + q] = c[5 * stride + q] = 0.0;
    }
}

}  // namespace

// The same for sensitivities, (terms, nodes x np): the polynomials through values and derivatives at both ends of the step, as dense() does.
void Outputs::sensitivity_terms(const int* obs, int nobs) {
    const size_t np = np_, stride = padded(nobs * np_);
    const auto active = std::count_if(step_.noise.begin(), step_.noise.end(), [](const Noise& z) { return z.active; });
    slope_terms_.resize((POWERS + 2 * static_cast<size_t>(active)) * stride);
    for (int j = 0; j < nobs; ++j) {
        const size_t from = obs[j] * np;
        const Ends e{state_.S.data() + from, step_.S1.data() + from, step_.sd0.data() + from, step_.sd1.data() + from, step_.sdd0.data() + from, step_.sdd1.data() + from};
        if (gentle(obs[j])) quintic(slope_terms_.data() + j * np, stride, e, step_.h, np_);
        else cubic(slope_terms_.data() + j * np, stride, e, step_.h, np_);
        size_t row = POWERS;
        for (const Noise& z : step_.noise)
            if (z.active)
                for (const auto* v : {&z.sb, &z.sc})
                    std::copy(v->begin() + from, v->begin() + from + np, slope_terms_.begin() + row++ * stride + j * np);
    }
}

// Whether all have a delay, so that the terms above are all there is to know of them.
bool Outputs::delayed(const int* obs, int nobs) const {
    return std::all_of(obs, obs + nobs, [&](int i) { return i < n_ && !slaved_.fast.is[i]; });
}

// m rows of outputs at increasing times: T (m, nodes) and, where asked for, S (m, nodes, np).
void Outputs::rows(const double* times, long m, const int* obs, int nobs, double* T, double* S) {
    const bool plain = delayed(obs, nobs);
    need_u = !plain || !p_.guards.empty();
    if (plain) temperature_terms(obs, nobs);
    if (S && plain) sensitivity_terms(obs, nobs);
    else if (S) sensitivity_terms(setup_.all.data(), n_);
    const size_t wide = static_cast<size_t>(nobs) * np_;
    for (long k = 0; k < m; k += CHUNK) {
        const int some = static_cast<int>(std::min<long>(CHUNK, m - k));
        if (plain) {
            weigh(times + k, some);
            weighted(T + k * nobs, shares_.data(), some, terms_.data(), count_, nobs);
            if (S) weighted(S + k * wide, shares_.data(), some, slope_terms_.data(), slope_count_, nobs * np_);
            if (S) add_idle(S + k * wide, some, obs, nobs);
            continue;
        }
        for (long r = k; r < k + some; ++r) {  // through the network: slaved nodes and boundaries are observed too
            const double s = times[r] == step_.end ? step_.h : times[r] - state_.t;
            nodes_at(s, times[r], true);
            for (int j = 0; j < nobs; ++j) T[r * nobs + j] = view.t[obs[j]];
            if (!S) continue;
            weigh(times + r, 1);
            slaved_row(s, times[r], obs, nobs, S + r * wide);
        }
    }
}

// Sensitivities of any nodes and boundaries at s, where the temperatures of the view stand.
void Outputs::slaved_row(double s, double time, const int* obs, int nobs, double* S) {
    const size_t np = np_;
    const double x = s / step_.h, y = 1.0 - x;
    weighted(SO_.data(), shares_.data(), 1, slope_terms_.data(), slope_count_, n_ * np_);
    add_idle(SO_.data(), 1, setup_.all.data(), n_);
    if (jumped_) {
        view.t.swap(before_);
        side(time, true);
    }
    if (!slaved_.fast.nodes.empty()) {
        slaved_.rows(slaved_.fast, view);
        // d/dp of C dT/dt, by the slopes of the cubics of T and S
        lag_s_.assign(slaved_.fast.nodes.size() * np, 0.0);
        for (size_t f = 0; f < slaved_.fast.nodes.size(); ++f) {
            const int i = slaved_.fast.nodes[f], c = p_.capacity[i];
            if (setup_.cap[i] == 0.0) continue;
            double* to = lag_s_.data() + f * np;
            const double g = 6.0 * x * y / step_.h, a = 1.0 - x * (4.0 - 3.0 * x), b = x * (3.0 * x - 2.0);
            for (size_t q = 0; q < np; ++q)
                to[q] = setup_.cap[i] * (g * (step_.S1[i * np + q] - state_.S[i * np + q]) + a * step_.sd0[i * np + q] + b * step_.sd1[i * np + q]);
            if (d_.any(c))
                for (int e = d_.indptr[c]; e < d_.indptr[c + 1]; ++e) to[d_.indices[e]] += d_.data[e] * slope(i, x) / step_.h;
        }
        slaved_.sensitivity(slaved_.fast, view, SO_.data(), lag_s_.data());
    }
    if (jumped_) {
        view.t.swap(before_);
        side(time, false);
        slaved_.rows(slaved_.massless, view);
        slaved_.sensitivity(slaved_.massless, view, SO_.data());
    }
    for (int j = 0; j < nobs; ++j) {
        double* to = S + j * np;
        if (obs[j] < n_) {
            std::copy(SO_.begin() + obs[j] * np, SO_.begin() + (obs[j] + 1) * np, to);
            continue;
        }
        std::fill(to, to + np, 0.0);
        for (int c : {p_.gain[obs[j] - n_], p_.offset[obs[j] - n_]}) {
            if (c >= p_.nc) continue;
            const double u = p_.coef_input[c] < 0 ? 1.0 : view.u[p_.coef_input[c]];
            for (int q = d_.indptr[c]; q < d_.indptr[c + 1]; ++q) to[d_.indices[q]] += u * d_.data[q];
        }
    }
}

// Readings up to output `last` against the model, reduced to as few rows as the step has terms.
void Outputs::collect(const double* times, long last) {
    double when[CHUNK];
    for (size_t g = 0; g < squares_->groups(); ++g) {
        const ReadingGroup& group = squares_->group(g);
        const int nodes = static_cast<int>(group.nodes.size());
        const bool plain = group.alone && delayed(group.nodes.data(), nodes);
        const long many = squares_->open(g, last, slope_count_, CHUNK);
        if (many == 0) continue;
        if (plain) {
            need_u = !p_.guards.empty();
            temperature_terms(group.nodes.data(), nodes);
            if (np_ > 0) sensitivity_terms(group.nodes.data(), nodes);
        }
        for (long k = 0; k < many; k += CHUNK) {
            const int m = static_cast<int>(std::min<long>(CHUNK, many - k));
            const long* at = squares_->upcoming();
            for (int r = 0; r < m; ++r) when[r] = times[at[r]];
            double* T = squares_->predicted(m);
            if (plain) {
                weigh(when, m);
                double* to = squares_->shares();
                for (int r = 0; r < m; ++r, to += squares_->stride())
                    for (int i = 0; i < slope_count_; ++i) to[i] = shares_[static_cast<size_t>(i) * CHUNK + r];
                weighted(T, shares_.data(), m, terms_.data(), count_, nodes);
                squares_->take(m);
            } else {
                double* S = squares_->slopes(m);
                rows(when, m, group.nodes.data(), nodes, T, S);
                squares_->take_rows(m);
            }
        }
        if (plain) squares_->close(slope_terms_.data());
    }
}

void Outputs::emit(OutputList& out, Result& r) {
    const long last = std::upper_bound(out.t + out.next, out.t + out.n, step_.end) - out.t;
    if (last == out.next) return;
    const int active = static_cast<int>(std::count_if(step_.noise.begin(), step_.noise.end(), [](const Noise& z) { return z.active; }));
    count_ = POWERS + 4 * active;
    slope_count_ = POWERS + 2 * active;
    if (squares_) {
        collect(out.t, last);
    } else {
        const size_t at = static_cast<size_t>(out.next) * out.nobs;
        rows(out.t + out.next, last - out.next, out.obs, out.nobs, r.traces + at, np_ > 0 ? r.sens + at * np_ : nullptr);
    }
    out.next = last;
}

}  // namespace thermid
