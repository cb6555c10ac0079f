// The linear network taken apart into modes and put together again; marching stands in march.cpp.
#include "modal/modal.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace thermid {

namespace {
constexpr double TWO_PI = 6.283185307179586476925;
double angle(const Input& in, double t) { return TWO_PI * t / in.period + in.phase; }
}  // namespace

Modal::Modal(const Problem& p, const double* coef) : p_(p), coef_(coef), all_(p.nodes()), cols_(1 + static_cast<int>(p.inputs.size())) {
    for (int r = 0; r < p.con.size(); ++r) {
        const int in = p.con.c0[r] < p.nc ? p.coef_input[p.con.c0[r]] : -1;
        if (p.con.kind[r] != LINEAR || (in >= 0 && p.inputs[in].kind != CONSTANT))
            throw std::invalid_argument("a conductor is not linear with a constant coefficient");
    }
    for (int k : p.load.kind)
        if (k != SIGNAL) throw std::invalid_argument("a load depends on temperature");
    if (!p.followers.empty()) throw std::invalid_argument("a coefficient follows a temperature");
    if (p.control.size() > 0) throw std::invalid_argument("a load follows a control");
}

// Adds factor times a coefficient to a row of sources.
void Modal::add_source(double* row, int coefficient, double factor) const {
    if (coefficient >= p_.nc) return;
    const int in = p_.coef_input[coefficient];
    const double v = factor * coef_[coefficient];
    row[0] += in < 0 ? v : v * p_.inputs[in].mean;
    if (in >= 0 && p_.inputs[in].kind != CONSTANT) row[1 + in] += v;
}

void Modal::check(const double* start, double t0) const {
    for (int i = 0; i < p_.n; ++i) {
        if (!std::isfinite(start[i]) || !(start[i] >= 0.0)) throw Failure{BAD_INPUT, i};
        const double c = p_.capacity[i] >= 0 ? coef_[p_.capacity[i]] : 1.0;
        if (!(c > 0.0 && std::isfinite(c))) throw Failure{BAD_INPUT, i};
    }
    for (int j = 0; j < p_.nc; ++j)
        if (!std::isfinite(coef_[j])) throw Failure{BAD_INPUT, -1};
    for (int k = 0; k < p_.nb; ++k) {
        double t = 0.0;
        for (int c : {p_.gain[k], p_.offset[k]})
            if (c < p_.nc) t += coef_[c] * (p_.coef_input[c] < 0 ? 1.0 : p_.inputs[p_.coef_input[c]].at(t0));
        if (!(t >= 0.0) || !std::isfinite(t)) throw Failure{BAD_INPUT, p_.n + k};
    }
}

// Conductances between all nodes, and what sources do to nodes and boundaries.
void Modal::assemble() {
    g_.assign(static_cast<size_t>(all_) * all_, 0.0);
    heat_.assign(static_cast<size_t>(p_.n) * cols_, 0.0);
    edge_.assign(static_cast<size_t>(p_.nb) * cols_, 0.0);
    for (int r = 0; r < p_.con.size(); ++r) {
        const int a = p_.con.a[r], b = p_.con.b[r], c = p_.con.c0[r];
        if (c >= p_.nc || (a >= p_.n && b >= p_.n)) continue;
        const double v = coef_[c] * (p_.coef_input[c] < 0 ? 1.0 : p_.inputs[p_.coef_input[c]].mean);
        if (!(v >= 0.0)) throw Failure{BAD_INPUT, std::min(a, b)};
        g_[a * all_ + b] += v;
        g_[b * all_ + a] += v;
    }
    for (int r = 0; r < p_.load.size(); ++r) add_source(heat_.data() + p_.load.node[r] * cols_, p_.load.c[0][r], 1.0);
    for (int k = 0; k < p_.nb; ++k) {
        for (int c : {p_.gain[k], p_.offset[k]}) add_source(edge_.data() + k * cols_, c, 1.0);
        edge_[k * cols_] -= ref_;
    }
}

// Star to mesh for every massless node, heats shared in the same proportion; no subtraction, so nothing cancels. The row of the node is left
// with its weights over the nodes that remain, its heats with what they add to its temperature.
void Modal::eliminate() {
    std::vector<char> gone(all_, 0);
    for (int m : p_.massless) {
        double* w = g_.data() + m * all_;
        double total = 0.0;
        for (int j = 0; j < all_; ++j) total += gone[j] ? 0.0 : w[j];
        if (!(total > 0.0)) throw Failure{SINGULAR_NODE, m};
        gone[m] = 1;
        double* q = heat_.data() + m * cols_;
        for (int c = 0; c < cols_; ++c) q[c] /= total;
        for (int j = 0; j < all_; ++j) w[j] = gone[j] ? 0.0 : w[j] / total;
        for (int i = 0; i < p_.n; ++i) {
            if (gone[i] || w[i] == 0.0) continue;
            const double mine = w[i] * total;
            for (int j = 0; j < all_; ++j)
                if (j != i) {
                    g_[i * all_ + j] += mine * w[j];
                    if (j >= p_.n) g_[j * all_ + i] = g_[i * all_ + j];
                }
            for (int c = 0; c < cols_; ++c) heat_[i * cols_ + c] += mine * q[c];
        }
    }
}

// Modes of what is left, and what every temperature takes from them and directly from the sources.
void Modal::decompose() {
    const int ns = modes_ = static_cast<int>(states_.size());
    root_.resize(ns);
    for (int s = 0; s < ns; ++s) root_[s] = std::sqrt(coef_[p_.capacity[states_[s]]]);
    auto between = [&](int s, int t) { return g_[states_[s] * all_ + states_[t]]; };
    int m = ns;
    for (int s = 0; s < ns; ++s)
        for (int t = s + 1; t < ns; ++t) m += between(s, t) > 0.0;
    std::vector<double> f(static_cast<size_t>(m) * ns, 0.0), v;
    force_.assign(static_cast<size_t>(ns) * cols_, 0.0);
    std::vector<double> push(static_cast<size_t>(ns) * cols_);
    for (int s = 0, row = ns; s < ns; ++s) {
        const int i = states_[s];
        double outer = 0.0;
        for (int c = 0; c < cols_; ++c) push[s * cols_ + c] = heat_[i * cols_ + c];
        for (int b = 0; b < p_.nb; ++b) {
            const double g = g_[i * all_ + p_.n + b];
            outer += g;
            for (int c = 0; c < cols_; ++c) push[s * cols_ + c] += g * edge_[b * cols_ + c];
        }
        f[static_cast<size_t>(s) * m + s] = std::sqrt(outer) / root_[s];
        for (int t = s + 1; t < ns; ++t) {
            const double g = between(s, t);
            if (!(g > 0.0)) continue;
            f[static_cast<size_t>(s) * m + row] = std::sqrt(g) / root_[s];
            f[static_cast<size_t>(t) * m + row++] = -std::sqrt(g) / root_[t];
        }
    }
    for (size_t k = 0; k < f.size(); ++k)  // squares must not overflow
        if (!(std::fabs(f[k]) < 1e150)) throw Failure{NON_FINITE, states_[k / m]};
    if (!jacobi(f, m, ns, rate_, vectors_)) throw Failure{NEWTON_FAILED, -1};
    shape_.assign(static_cast<size_t>(all_) * ns, 0.0);
    direct_.assign(static_cast<size_t>(all_) * cols_, 0.0);
    for (int s = 0; s < ns; ++s)
        for (int j = 0; j < ns; ++j) {
            const double w = shape_[states_[s] * ns + j] = vectors_[static_cast<size_t>(j) * ns + s] / root_[s];
            for (int c = 0; c < cols_; ++c) force_[j * cols_ + c] += w * push[s * cols_ + c];
        }
    std::copy(edge_.begin(), edge_.end(), direct_.begin() + p_.n * cols_);
    for (auto at = p_.massless.rbegin(); at != p_.massless.rend(); ++at) {
        const int i = *at;
        for (int c = 0; c < cols_; ++c) direct_[i * cols_ + c] = heat_[i * cols_ + c];
        for (int k = 0; k < all_; ++k) {
            const double w = g_[i * all_ + k];
            if (w == 0.0) continue;
            for (int j = 0; j < ns; ++j) shape_[i * ns + j] += w * shape_[k * ns + j];
            for (int c = 0; c < cols_; ++c) direct_[i * cols_ + c] += w * direct_[k * cols_ + c];
        }
    }
}

double Modal::wave(int k, double t, bool sine) const {
    const Input& in = p_.inputs[sines_[k]];
    const double x = angle(in, t);
    return sine ? std::sin(x) : std::cos(x);
}

double Modal::wave_area(int k, double t0, double t_end, bool sine) const {
    const Input& in = p_.inputs[sines_[k]];
    const double a = angle(in, t0), b = angle(in, t_end), span = TWO_PI / in.period * (t_end - t0);
    const double scale = span > 0.0 ? (t_end - t0) * std::sin(0.5 * span) / (0.5 * span) : 0.0, middle = 0.5 * (a + b);
    return scale * (sine ? std::sin(middle) : std::cos(middle));
}

// The state of the modes at the start, less the steady answer to every sine: z' = -rate z + b sin x, x' = w, has the particular solution
// b (rate sin x - w cos x) / (rate^2 + w^2).
void Modal::begin(const double* start, double t0) {
    const int ns = modes_, nw = static_cast<int>(sines_.size());
    lanes_ = padded(ns);
    z_.assign(lanes_, 0.0);
    total_.assign(lanes_, 0.0);
    for (auto* v : {&wave_s_, &wave_c_}) v->assign(static_cast<size_t>(ns) * nw, 0.0);
    for (int j = 0; j < ns; ++j) {
        for (int s = 0; s < ns; ++s) z_[j] += vectors_[static_cast<size_t>(j) * ns + s] * root_[s] * (start[states_[s]] - ref_);
        for (int k = 0; k < nw; ++k) {
            const Input& in = p_.inputs[sines_[k]];
            const double w = TWO_PI / in.period, size = std::hypot(rate_[j], w), b = force_[j * cols_ + 1 + sines_[k]] * in.amplitude / size;
            wave_s_[j * nw + k] = b * (rate_[j] / size);
            wave_c_[j * nw + k] = -b * (w / size);
            z_[j] -= wave_s_[j * nw + k] * wave(k, t0, true) + wave_c_[j * nw + k] * wave(k, t0, false);
        }
    }
}

// Final temperatures, and heats from the integrals of temperatures and sources.
void Modal::finish(double t0, double t_end, Result& r) {
    const int ns = modes_, nw = static_cast<int>(sines_.size());
    std::vector<double> now(cols_, 0.0), warmth(all_, 0.0);
    now[0] = 1.0;
    area_[0] = t_end - t0;
    for (int i : sampled_) now[1 + i] = p_.inputs[i].at(t_end) - p_.inputs[i].mean;
    for (int k = 0; k < nw; ++k) {
        const double s = wave(k, t_end, true), c = wave(k, t_end, false), as = wave_area(k, t0, t_end, true), ac = wave_area(k, t0, t_end, false);
        now[1 + sines_[k]] = p_.inputs[sines_[k]].amplitude * s;
        area_[1 + sines_[k]] = p_.inputs[sines_[k]].amplitude * as;
        for (int j = 0; j < ns; ++j) {
            z_[j] += wave_s_[j * nw + k] * s + wave_c_[j * nw + k] * c;
            total_[j] += wave_s_[j * nw + k] * as + wave_c_[j * nw + k] * ac;
        }
    }
    r.final_t.assign(p_.n, ref_);
    for (int i = 0; i < all_; ++i) {
        double t = 0.0;
        for (int j = 0; j < ns; ++j) {
            t += shape_[i * ns + j] * z_[j];
            warmth[i] += shape_[i * ns + j] * total_[j];
        }
        for (int c = 0; c < cols_; ++c) {
            t += direct_[i * cols_ + c] * now[c];
            warmth[i] += direct_[i * cols_ + c] * area_[c];
        }
        if (i < p_.n) r.final_t[i] += t;
    }
    r.load_energy.assign(p_.load.size(), 0.0);
    for (int k = 0; k < p_.load.size(); ++k) {
        std::vector<double> row(cols_, 0.0);
        add_source(row.data(), p_.load.c[0][k], 1.0);
        for (int c = 0; c < cols_; ++c) r.load_energy[k] += row[c] * area_[c];
    }
    r.conductor_energy.assign(p_.con.size(), 0.0);
    r.boundary_energy.assign(p_.nb, 0.0);
    for (int k = 0; k < p_.con.size(); ++k) {
        const int a = p_.con.a[k], b = p_.con.b[k], c = p_.con.c0[k];
        const double g = c >= p_.nc ? 0.0 : coef_[c] * (p_.coef_input[c] < 0 ? 1.0 : p_.inputs[p_.coef_input[c]].mean);
        const double heat = r.conductor_energy[p_.con.original[k]] = g * (warmth[a] - warmth[b]);
        if (b >= p_.n) r.boundary_energy[b - p_.n] += heat;
        if (a >= p_.n) r.boundary_energy[a - p_.n] -= heat;
    }
}

void Modal::run(const double* start, double t0, double t_end, const double* out_t, long nout, const int* obs, int nobs,
                const std::function<void()>& poll, Result& r, const Sums* sums) {
    r.time = t0;
    try {
        check(start, t0);
        for (int i = 0; i < p_.n; ++i)
            if (p_.capacity[i] >= 0) states_.push_back(i);
        for (int k = 0; k + 1 < cols_; ++k) {
            if (p_.inputs[k].sampled()) sampled_.push_back(k);
            else if (p_.inputs[k].kind == SINE && p_.inputs[k].amplitude != 0.0) sines_.push_back(k);
        }
        ref_ = start[0];
        area_.assign(cols_, 0.0);
        assemble();
        eliminate();
        decompose();
        begin(start, t0);
        outputs(obs, nobs);
        if (sums) {
            follow(out_t, nout, obs, nobs, *sums, t0);
            survey(t0, t_end);
            weave(out_t, nout);
        }
        march(out_t, nout, obs, nobs, t0, t_end, poll, r);
        if (sums) turnings_.end();
        r.turnings.swap(turnings_.found);
        finish(t0, t_end, r);
        for (int i = 0; i < p_.n; ++i) {
            if (!std::isfinite(r.final_t[i])) throw Failure{NON_FINITE, i};
            if (!(r.final_t[i] > COLDEST && r.final_t[i] < 1e5)) throw beyond(p_, i, r.final_t[i]);
        }
    } catch (const Failure& f) {
        r.status = f.status;
        r.node = f.node;
    }
}

}  // namespace thermid
