// Dense output: quintic Hermite in time for the smooth part, plus the known response to what the projection left out.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"

namespace thermid {

// Prepares the corrections and returns the estimated error of what they neglect, in kelvin.
// dT = (b + s db) w + (A b - db) ww + A A b www; the next term of the series is the estimate.
double Integrator::input_error() {
    double total = 0.0;
    make_slaved(fast_, leftover_ ? 1e-4 : 1e-2);
    if (!leftover_) {
        for (Noise& z : noise_) z.active = false;
        std::copy(drift_.begin(), drift_.end(), drift_next_.begin());
        return 0.0;
    }
    if (!fast_.nodes.empty()) factor_slaved(fast_, J0_.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = noise_[k];
        z.active = p_.inputs[k].sampled() && !in_[k].exact;
        if (!z.active) continue;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        rate(fast_, J0_.data(), fu_.data() + static_cast<size_t>(k) * n_, dir_.data(), z.b.data());
        bb_ = z.b;
        rate(fast_, J0_.data(), nullptr, bb_.data(), z.ab.data());
        dir_ = z.ab;
        rate(fast_, J0_.data(), nullptr, dir_.data(), z.aab.data());
        dir_ = z.aab;
        rate(fast_, J0_.data(), nullptr, dir_.data(), bb_.data());
        double big = 0.0;
        for (int i = 0; i < n_; ++i) big = std::max(big, std::fabs(bb_[i]));
        total += big * 0.25 * h_ * worst_[k];
    }
    return total + curvature();
}

// What the curvature of the laws at the inputs' boundaries makes of the mean square of what is left over: each node drifts towards
// |f_uu| / 2 |J| of it, with its own time constant. The largest drift at the step's end.
double Integrator::curvature() {
    std::fill(bend_.begin(), bend_.end(), 0.0);
    const Conductors& c = p_.con;
    for (const Entry& e : con_u_) {
        const int k = p_.coef_input[e.coef], r = e.row, kind = c.kind[r], node = e.what == 4 ? c.b[r] : c.a[r];
        if (e.what < 4 || is(kind, STRAIGHT) || node >= n_ || !noise_[k].active) continue;
        const double g = coef_[e.coef], ta = e_.t[c.a[r]], tb = e_.t[c.b[r]];
        const auto x = conductor<false, Dual>(kind, Dual(ta, e.what == 4), Dual(tb, e.what == 5), e_.ceff[c.c0[r]], e_.ceff[c.c1[r]],
                                              p_.tables.data() + c.table[r]);
        const double second = e.what == 4 ? x.qa.e : x.qb.e;  // d^2 q / d end^2
        bend_[node] += 0.5 * std::fabs(second) * g * g * in_[k].variance;
    }
    double worst = 0.0;
    for (int i = 0; i < n_; ++i) {
        const double own = h_ * std::fabs(J0_[p_.pattern.diag[i]]);
        // (h / C) bend / (1 + h |J| / C): at once for a massless node, and towards bend / |J|
        drift_next_[i] = (cap_[i] * drift_[i] + h_ * bend_[i]) / std::max(cap_[i] + own, 1e-300);
        worst = std::max(worst, drift_next_[i]);
    }
    return worst;
}

// What the dense output of the sensitivities needs of the step's start, while the evaluation still stands there.
void Integrator::dense_start() {
    slope_sensitivity(0, d0_, sd0_);
    rate_sensitivity(quick_, e_, J0_.data(), d0_.data(), uder0_.data(), S_.data(), sd0_.data(), dd0_.data(), sdd0_.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = noise_[k];
        if (!z.active) continue;
        std::fill(unit_.begin(), unit_.end(), 0.0);
        unit_[k] = 1.0;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        respond(fast_, J0_.data(), fu_.data() + static_cast<size_t>(k) * n_, dir_.data());
        std::fill(dirS_.begin(), dirS_.end(), 0.0);
        rate_sensitivity(fast_, e_, J0_.data(), dir_.data(), unit_.data(), S_.data(), dirS_.data(), z.b.data(), z.sb.data());
        bb_ = z.b;
        respond(fast_, J0_.data(), nullptr, bb_.data());
        dirS_ = z.sb;
        rate_sensitivity(fast_, e_, J0_.data(), bb_.data(), nullptr, S_.data(), dirS_.data(), z.ab.data(), z.sc.data());
    }
}

// Nodes far faster than the step that settle within it: what their settling, over long before the first output, does to the slopes of the
// others at the step's start, and so to the outputs within the step. The temperatures at its end hardly feel it. [K]
double Integrator::unsettled() {
    if (quick_.nodes.size() == massless_.nodes.size()) return 0.0;
    std::fill(bb_.begin(), bb_.end(), 0.0);
    std::fill(dir_.begin(), dir_.end(), 0.0);
    for (int i : quick_.nodes) bb_[i] = F_[i] - F_[(STAGES - 1) * static_cast<size_t>(n_) + i];
    rate(quick_, J0_.data(), bb_.data(), dir_.data(), err_.data());
    double most = 0.0;
    for (int i = 0; i < n_; ++i) most = std::max(most, 0.15 * h_ * std::fabs(err_[i]));  // a slope weighs s (1 - s)^2 in a cubic
    return most;
}

// After an accepted step: derivatives at its end and the polynomials of every node.
void Integrator::dense(bool inside) {
    const size_t n = n_, np = np_;
    if (!inside) return;
    if (leftover_) {  // the end has been improved since the last stage
        std::copy(T1_.begin(), T1_.end(), e_.t.begin());
        e_.rows();
        for (int i = 0; i < n_; ++i) F_[(STAGES - 1) * n + i] = cap_[i] > 0.0 ? e_.f[i] : 0.0;
    }
    if (np == 0 || constant_ || leftover_) e_.slopes(J1_.data());  // else they stand there since the last stage
    if (leftover_ && np > 0) heat_sensitivity(J1_.data(), S1_.data(), FS_.data() + (STAGES - 1) * n * np);
    for (int i = 0; i < n_; ++i) d1_[i] = cap_[i] > 0.0 ? F_[(STAGES - 1) * n + i] / cap_[i] : 0.0;
    std::fill(g_.begin(), g_.end(), 0.0);
    if (nk_ > 0) {
        e_.input_slopes(pushes_, other_u_, load_u_, fu_.data());
        for (int k = 0; k < nk_; ++k) {
            uder1_[k] = p_.inputs[k].sampled() ? in_[k].slope(h_) : p_.inputs[k].slope(t_ + h_);
            if (uder1_[k] != 0.0) axpy(g_.data(), uder1_[k], fu_.data() + k * n, n_);
        }
    }
    if (!quick_.nodes.empty()) factor_slaved(quick_, J1_.data());
    rate(quick_, J1_.data(), g_.data(), d1_.data(), dd1_.data());
    for (int i = 0; i < n_; ++i) {
        const double y = T1_[i] - T_[i], a = h_ * d0_[i], b = h_ * d1_[i];
        double* c = poly_.data() + i;
        c[0] = T_[i];
        c[n] = a;
        if (gentle(i)) {
            const double p = h_ * h_ * dd0_[i], q = h_ * h_ * dd1_[i], z = y - a - 0.5 * p, z1 = b - a - p, z2 = q - p;
            c[2 * n] = 0.5 * p;
            c[3 * n] = 10.0 * z - 4.0 * z1 + 0.5 * z2;
            c[4 * n] = -15.0 * z + 7.0 * z1 - z2;
            c[5 * n] = 6.0 * z - 3.0 * z1 + 0.5 * z2;
        } else {  // second derivatives of a stiff node would only amplify its error
            c[2 * n] = 3.0 * y - 2.0 * a - b;
            c[3 * n] = a + b - 2.0 * y;
            c[4 * n] = c[5 * n] = 0.0;
        }
    }
    if (leftover_ && !fast_.nodes.empty()) factor_slaved(fast_, J1_.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = noise_[k];
        if (!z.active) continue;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        rate(fast_, J1_.data(), fu_.data() + k * n, dir_.data(), bb_.data());
        for (int i = 0; i < n_; ++i) {
            z.db[i] = (bb_[i] - z.b[i]) / h_;
            z.c[i] = z.ab[i] - z.db[i];
        }
    }
    for (int k = 0; k < nk_; ++k)
        if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], t_);
    at_ = 0.0;
    if (np == 0) return;
    slope_sensitivity(STAGES - 1, d1_, sd1_);
    rate_sensitivity(quick_, e_, J1_.data(), d1_.data(), uder1_.data(), S1_.data(), sd1_.data(), dd1_.data(), sdd1_.data());
}

// dS/dt of the nodes with capacity, from the heats of a stage.
void Integrator::slope_sensitivity(int stage, const std::vector<double>& slope, std::vector<double>& out) {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    std::copy(FS_.data() + stage * m, FS_.data() + (stage + 1) * m, out.data());
    capacity_term(out.data(), slope.data(), -1.0);
    scale_rows(out.data(), inv_cap_.data(), n_, np_);
}

void Integrator::move_cursors(double s, double time) {
    if (s < at_)
        for (int k = 0; k < nk_; ++k)
            if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], t_);
    at_ = s;
    for (int k = 0; k < nk_; ++k) {
        const Input& in = p_.inputs[k];
        if (!in.sampled()) {
            if (need_u_) eo_.u[k] = in.at(time);
            continue;
        }
        Noise& z = noise_[k];
        if (!z.active && !need_u_) continue;
        cursor_[k].move(time);
        eo_.u[k] = cursor_[k].value();
        z.w = z.active ? in_[k].w(s, cursor_[k].sum) : 0.0;
        z.ww = z.active ? in_[k].ww(s, cursor_[k].sum) : 0.0;
        z.www = z.active ? in_[k].www(s, cursor_[k].sum) : 0.0;
    }
}

double Integrator::smooth(int i, double x) const {
    const double* c = poly_.data() + i;
    const size_t n = n_;
    return c[0] + x * (c[n] + x * (c[2 * n] + x * (c[3 * n] + x * (c[4 * n] + x * c[5 * n]))));
}

// Its derivative in x.
double Integrator::slope(int i, double x) const {
    const double* c = poly_.data() + i;
    const size_t n = n_;
    return c[n] + x * (2.0 * c[2 * n] + x * (3.0 * c[3 * n] + x * (4.0 * c[4 * n] + x * 5.0 * c[5 * n])));
}

// Puts held inputs that jump at a time to their values before it, or back to those from it on. Whether there are any.
bool Integrator::side(double time, bool before) {
    bool any = false;
    for (int k = 0; k < nk_; ++k) {
        const Input& in = p_.inputs[k];
        const int i = in.kind == SAMPLED_HOLD ? cursor_[k].segment() : -1;
        if (i < 1 || in.seg[i].t != time) continue;
        any = true;
        eo_.u[k] = in.mean + in.seg[before ? i - 1 : i].u;
    }
    if (any) eo_.set_inputs();
    return any;
}

// All temperatures at s into eo_.t, at the inputs' own values; those of slaved nodes only when asked for. Where an input jumps, what has a
// capacity has not moved yet, however fast it is; massless nodes and boundaries have.
void Integrator::nodes_at(double s, double time, bool slaved) {
    move_cursors(s, time);
    const double x = s / h_;
    eo_.set_inputs();
    for (int i = 0; i < n_; ++i) eo_.t[i] = smooth(i, x);
    for (const Noise& z : noise_)
        if (z.active)
            for (int i = 0; i < n_; ++i) eo_.t[i] += (z.b[i] + s * z.db[i]) * z.w + z.c[i] * z.ww + z.aab[i] * z.www;
    if (!p_.followers.empty()) eo_.follow();
    jumped_ = false;
    if (!slaved || fast_.nodes.empty()) return;
    // A fast node still takes up heat while it follows: C dT/dt with the slope of its own polynomial.
    lag_.resize(fast_.nodes.size());
    for (size_t k = 0; k < lag_.size(); ++k) lag_[k] = cap_[fast_.nodes[k]] * slope(fast_.nodes[k], x) / h_;
    jumped_ = fast_.nodes.size() > massless_.nodes.size() && side(time, true);
    solve_slaved(fast_, eo_, lag_.data());
    if (!jumped_) return;
    before_ = eo_.t;
    side(time, false);
    if (!massless_.nodes.empty()) solve_slaved(massless_, eo_);
}

}  // namespace thermid
