// Dense output: quintic Hermite in time for the smooth part, plus the known response to what the projection left out.
#include <algorithm>
#include <cmath>

#include "algebra/traces.hpp"
#include "integrator/outputs.hpp"

namespace thermid {

// What the dense output of the sensitivities needs of the step's start, while the evaluation still stands there.
void Outputs::dense_start() {
    slope_sensitivity(0, step_.d0, step_.sd0);
    slaved_.rate_sensitivity(slaved_.quick, step_.e, step_.J0.data(), step_.d0.data(), step_.uder0.data(), state_.S.data(), step_.sd0.data(), step_.dd0.data(), step_.sdd0.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = step_.noise[k];
        if (!z.active) continue;
        for (auto* v : {&z.sb, &z.sc}) v->resize(state_.S.size());  // of hundreds of inputs hardly any is active
        std::fill(unit_.begin(), unit_.end(), 0.0);
        unit_[k] = 1.0;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        slaved_.respond(slaved_.fast, step_.J0.data(), step_.fu.data() + static_cast<size_t>(k) * n_, dir_.data());
        std::fill(dirS_.begin(), dirS_.end(), 0.0);
        slaved_.rate_sensitivity(slaved_.fast, step_.e, step_.J0.data(), dir_.data(), unit_.data(), state_.S.data(), dirS_.data(), z.b.data(), z.sb.data());
        bb_ = z.b;
        slaved_.respond(slaved_.fast, step_.J0.data(), nullptr, bb_.data());
        dirS_ = z.sb;
        slaved_.rate_sensitivity(slaved_.fast, step_.e, step_.J0.data(), bb_.data(), nullptr, state_.S.data(), dirS_.data(), z.ab.data(), z.sc.data());
    }
    if (!setup_.idle.empty()) idle_start();
}

// The same for idle inputs, of which only the parameters of their own coefficients remain: what one of these moves is the heat that the input would bring.
void Outputs::idle_start() {
    const auto put = [&](int node, double heat) {
        if (node < n_) g_[node] += heat;
    };
    double* b = step_.idle_b.data();
    double* ab = step_.idle_ab.data();
    if (p_.guards.empty()) unseen_ = setup_.idles;  // the instant of a switching hangs on thresholds
    for (const IdleInput& x : setup_.idle) {
        for (const auto& part : x.parts)
            if (!part.load || slaved_.fast.is[p_.load.node[part.entry.row]]) unseen_[x.input] = 0;
        if (!step_.in[x.input].exact) {
            std::fill(g_.begin(), g_.end(), 0.0);
            for (const auto& part : x.parts) {
                const int r = part.entry.row;
                const double heat = part.factor * (part.load ? step_.e.load_slope(part.entry) : step_.e.con_slope(part.entry));
                put(part.load ? p_.load.node[r] : p_.con.b[r], heat);
                if (!part.load && !is(p_.con.kind[r], ONE_WAY)) put(p_.con.a[r], -heat);
            }
            std::fill(dir_.begin(), dir_.end(), 0.0);
            slaved_.rate(slaved_.fast, step_.J0.data(), g_.data(), dir_.data(), b);
            std::copy(b, b + n_, dir_.begin());
            slaved_.rate(slaved_.fast, step_.J0.data(), nullptr, dir_.data(), ab);
        }
        b += n_;
        ab += n_;
    }
}

// After an accepted step: derivatives at its end and the polynomials of every node.
void Outputs::dense(bool inside) {
    const size_t n = n_, np = np_;
    if (!inside) return;
    if (step_.leftover) {  // the end has been improved since the last stage
        std::copy(step_.T1.begin(), step_.T1.end(), step_.e.t.begin());
        step_.e.rows();
        for (int i = 0; i < n_; ++i) step_.F[(STAGES - 1) * n + i] = setup_.cap[i] > 0.0 ? step_.e.f[i] : 0.0;
    }
    if (np == 0 || setup_.constant || step_.leftover) step_.e.slopes(step_.J1.data());  // else they stand there since the last stage
    if (step_.leftover && np > 0) stages_.heat_sensitivity(step_.J1.data(), step_.S1.data(), step_.FS.data() + (STAGES - 1) * n * np);
    for (int i = 0; i < n_; ++i) step_.d1[i] = setup_.cap[i] > 0.0 ? step_.F[(STAGES - 1) * n + i] / setup_.cap[i] : 0.0;
    std::fill(g_.begin(), g_.end(), 0.0);
    if (nk_ > 0) {
        step_.e.input_slopes(setup_.pushes, setup_.other_u, setup_.load_u, step_.fu.data());
        for (int k = 0; k < nk_; ++k) {
            step_.uder1[k] = p_.inputs[k].sampled() ? step_.in[k].slope(step_.h) : p_.inputs[k].slope(state_.t + step_.h);
            if (step_.uder1[k] != 0.0) axpy(g_.data(), step_.uder1[k], step_.fu.data() + k * n, n_);
        }
    }
    if (!slaved_.quick.nodes.empty()) slaved_.factor(slaved_.quick, step_.J1.data());
    slaved_.rate(slaved_.quick, step_.J1.data(), g_.data(), step_.d1.data(), step_.dd1.data());
    for (int i = 0; i < n_; ++i) {
        const double y = step_.T1[i] - state_.T[i], a = step_.h * step_.d0[i], b = step_.h * step_.d1[i];
        double* c = poly_.data() + i;
        c[0] = state_.T[i];
        c[n] = a;
        if (gentle(i)) {
            const double p = step_.h * step_.h * step_.dd0[i], q = step_.h * step_.h * step_.dd1[i], z = y - a - 0.5 * p, z1 = b - a - p, z2 = q - p;
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
    if (step_.leftover && !slaved_.fast.nodes.empty()) slaved_.factor(slaved_.fast, step_.J1.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = step_.noise[k];
        if (!z.active) continue;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        slaved_.rate(slaved_.fast, step_.J1.data(), step_.fu.data() + k * n, dir_.data(), bb_.data());
        for (int i = 0; i < n_; ++i) {
            z.db[i] = (bb_[i] - z.b[i]) / step_.h;
            z.c[i] = z.ab[i] - z.db[i];
        }
    }
    for (int k = 0; k < nk_; ++k)
        if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], state_.t);
    at_ = 0.0;
    if (np == 0) return;
    slope_sensitivity(STAGES - 1, step_.d1, step_.sd1);
    slaved_.rate_sensitivity(slaved_.quick, step_.e, step_.J1.data(), step_.d1.data(), step_.uder1.data(), step_.S1.data(), step_.sd1.data(), step_.dd1.data(), step_.sdd1.data());
}

// By how much the polynomials and the stages differ about the middle of the step, filtered as the estimate of its end is: large where a node settles
// within the step, which no polynomial follows. [K]
double Outputs::apart() {
    for (int i = 0; i < n_; ++i) {
        double heat = 0.0;
        for (int s = 0; s < STAGES; ++s) heat += HALFWAY[s] * step_.F[s * static_cast<size_t>(n_) + i];
        g_[i] = setup_.cap[i] > 0.0 ? step_.h * heat - setup_.cap[i] * (smooth(i, 0.5) - state_.T[i]) : 0.0;
    }
    step_.factors.solve(g_.data(), 1e-2);
    double most = 0.0;
    for (int i = 0; i < n_; ++i)
        if (setup_.cap[i] > 0.0 && !slaved_.fast.is[i]) most = std::max(most, std::fabs(g_[i]));
    return most;
}

// Ends the step at s instead, where nothing is left over of the inputs: its polynomials are written for the shorter step, which they are right for too.
// Heats are those of the polynomials, by Gauss's rule of sixth order, and the balance is closed as that of a whole step is: so steps need not be cut to
// land on a switching, which took two more trials and their factors.
void Outputs::shorten(double s) {
    constexpr double PLACE[3] = {0.1127016653792583, 0.5, 0.8872983346207417}, SHARE[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    const double x = s / step_.h, whole = step_.h, end = state_.t + s;
    const size_t n = n_, np = np_, m = n * np;
    const bool heats = o_.energy || errors_.closes();
    if (heats) {
        std::fill(step_.acc_con.begin(), step_.acc_con.end(), 0.0);
        std::fill(step_.acc_load.begin(), step_.acc_load.end(), 0.0);
        for (int k = 0; k < 3; ++k) {
            nodes_at(PLACE[k] * s, true);
            view.rows();
            axpy(step_.acc_con.data(), SHARE[k], view.q.data(), p_.con.size());
            axpy(step_.acc_load.data(), SHARE[k], view.power.data(), p_.load.size());
        }
    }
    nodes_at(s, end, true);
    std::copy(view.t.begin(), view.t.begin() + n_, step_.T1.begin());
    if (np > 0) {
        count_ = slope_count_ = POWERS;
        sensitivity_terms(setup_.all.data(), n_);
        weigh(&end, 1);
        slaved_row(s, end, setup_.all.data(), n_, dirS_.data());
        const size_t stride = padded(n_ * np_);
        for (size_t q = 0; q < m; ++q) {
            const double *c0 = slope_terms_.data() + q, h2 = whole * whole;
            double c[POWERS];
            for (int k = 0; k < POWERS; ++k) c[k] = c0[k * stride];
            step_.sd1[q] = (c[1] + x * (2.0 * c[2] + x * (3.0 * c[3] + x * (4.0 * c[4] + x * 5.0 * c[5])))) / whole;
            step_.sdd0[q] = 2.0 * c[2] / h2;
            step_.sdd1[q] = (2.0 * c[2] + x * (6.0 * c[3] + x * (12.0 * c[4] + x * 20.0 * c[5]))) / h2;
        }
        step_.S1.swap(dirS_);
    }
    for (int i = 0; i < n_; ++i) step_.d1[i] = setup_.cap[i] > 0.0 ? slope(i, x) / whole : 0.0;
    double power = 1.0;
    for (int k = 1; k < POWERS; ++k) {
        power *= x;
        for (size_t i = k * n; i < (k + 1) * n; ++i) poly_[i] *= power;
    }
    step_.h = s;
    step_.end = end;
    for (int k = 0; k < nk_; ++k) step_.uder1[k] = p_.inputs[k].sampled() ? step_.in[k].slope(s) : p_.inputs[k].slope(end);
    stages_.set_inputs(s);
    std::copy(step_.T1.begin(), step_.T1.end(), step_.e.t.begin());
    step_.e.rows();
    if (!heats) return;
    errors_.close_balance(whole);
    std::copy(step_.T1.begin(), step_.T1.end(), step_.e.t.begin());
}

// dS/dt of the nodes with capacity, from the heats of a stage.
void Outputs::slope_sensitivity(int stage, const std::vector<double>& slope, std::vector<double>& out) {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    std::copy(step_.FS.data() + stage * m, step_.FS.data() + (stage + 1) * m, out.data());
    setup_.capacity_term(out.data(), slope.data(), -1.0);
    scale_rows(out.data(), setup_.inv_cap.data(), n_, np_);
}

void Outputs::move_cursors(double s, double time) {
    if (s < at_)
        for (int k = 0; k < nk_; ++k)
            if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], state_.t);
    at_ = s;
    for (int k = 0; k < nk_; ++k) {
        const Input& in = p_.inputs[k];
        if (!in.sampled()) {
            if (need_u) view.u[k] = in.at(time);
            continue;
        }
        Noise& z = step_.noise[k];
        if (!z.active && (!need_u || unseen_[k])) continue;
        cursor_[k].move(time);
        view.u[k] = cursor_[k].value();
        z.w = z.active ? step_.in[k].w(s, cursor_[k].sum) : 0.0;
        z.ww = z.active ? step_.in[k].ww(s, cursor_[k].sum) : 0.0;
        z.www = z.active ? step_.in[k].www(s, cursor_[k].sum) : 0.0;
    }
}

double Outputs::smooth(int i, double x) const {
    const double* c = poly_.data() + i;
    const size_t n = n_;
    return c[0] + x * (c[n] + x * (c[2 * n] + x * (c[3 * n] + x * (c[4 * n] + x * c[5 * n]))));
}

// Its derivative in x.
double Outputs::slope(int i, double x) const {
    const double* c = poly_.data() + i;
    const size_t n = n_;
    return c[n] + x * (2.0 * c[2 * n] + x * (3.0 * c[3 * n] + x * (4.0 * c[4 * n] + x * 5.0 * c[5 * n])));
}

// Puts held inputs that jump at a time to their values before it, or back to those from it on. Whether there are any.
bool Outputs::side(double time, bool before) {
    bool any = false;
    for (int k = 0; k < nk_; ++k) {
        const Input& in = p_.inputs[k];
        const int i = in.kind == SAMPLED_HOLD ? cursor_[k].segment() : -1;
        if (i < 1 || in.seg[i].t != time) continue;
        any = true;
        view.u[k] = in.mean + in.seg[before ? i - 1 : i].u;
    }
    if (any) view.set_inputs();
    return any;
}

// All temperatures at s into view.t, at the inputs' own values; those of slaved nodes only when asked for. Where an input jumps, what has a
// capacity has not moved yet, however fast it is; massless nodes and boundaries have.
void Outputs::nodes_at(double s, double time, bool slaved) {
    move_cursors(s, time);
    const double x = s / step_.h;
    view.set_inputs();
    for (int i = 0; i < n_; ++i) view.t[i] = smooth(i, x);
    for (const Noise& z : step_.noise)
        if (z.active)
            for (int i = 0; i < n_; ++i) view.t[i] += (z.b[i] + s * z.db[i]) * z.w + z.c[i] * z.ww + z.aab[i] * z.www;
    if (!p_.followers.empty()) view.follow();
    jumped_ = false;
    if (!slaved || slaved_.fast.nodes.empty()) return;
    // A fast node still takes up heat while it follows: C dT/dt with the slope of its own polynomial.
    lag_.resize(slaved_.fast.nodes.size());
    for (size_t k = 0; k < lag_.size(); ++k) lag_[k] = setup_.cap[slaved_.fast.nodes[k]] * slope(slaved_.fast.nodes[k], x) / step_.h;
    jumped_ = slaved_.fast.nodes.size() > slaved_.massless.nodes.size() && side(time, true);
    slaved_.solve(slaved_.fast, view, lag_.data());
    if (!jumped_) return;
    before_ = view.t;
    side(time, false);
    if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, view);
}

}  // namespace thermid
