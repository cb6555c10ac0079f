// The stages of one step: Newton in stage values, and the exact derivative of the converged scheme.
//   C (T_s - T_n) = h sum_j a_sj f(T_j) for nodes with capacity, f(T_s) = 0 for those without.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"

namespace thermid {

namespace {
// Extrapolates to each stage what a smooth law leaves beyond its tangent, tau^2 (a + b tau), from the two latest instants before it.
constexpr double BEYOND[STAGES][STAGES] = {{0.0}, {0.0}, {0.0, 0.440896}, {0.0, 2.636, -2.4911}, {0.0, 0.0, -5.2349, 3.3805}, {0.0, 0.0, 0.0, -1.6966, 2.2859}};
}

// a = capacities on the diagonal - length j; rows without a capacity are of the same size then, which LU without pivoting needs.
THERMID_CLONES static void shifted(double* THERMID_RESTRICT a, const double* THERMID_RESTRICT cap, double length, const double* THERMID_RESTRICT j, int m) {
    for (int k = 0; k < m; ++k) a[k] = cap[k] - length * j[k];
}

// What a stage leaves to be solved for: cap (t - t0) - base - h gamma f.
THERMID_CLONES static void residual(double* THERMID_RESTRICT r, const double* THERMID_RESTRICT cap, const double* THERMID_RESTRICT t,
                                    const double* THERMID_RESTRICT t0, const double* THERMID_RESTRICT base, double weight,
                                    const double* THERMID_RESTRICT f, int n) {
    for (int i = 0; i < n; ++i) r[i] = cap[i] * (t[i] - t0[i]) - base[i] - weight * f[i];
}

// The heats that a stage has found; none into nodes without capacity.
THERMID_CLONES static void heats(double* THERMID_RESTRICT F, const double* THERMID_RESTRICT cap, const double* THERMID_RESTRICT t,
                                 const double* THERMID_RESTRICT t0, const double* THERMID_RESTRICT base, double hg, int n) {
    for (int i = 0; i < n; ++i) F[i] = (cap[i] * (t[i] - t0[i]) - base[i]) / hg;
}

void Integrator::project() {
    leftover_ = false;
    for (int k = 0; k < nk_; ++k) {
        worst_[k] = 0.0;
        if (!p_.inputs[k].sampled()) continue;
        worst_[k] = in_[k].project(p_.inputs[k], t_, end_, hint_[k]);
        leftover_ = leftover_ || !in_[k].exact;
    }
}

void Integrator::set_stage_inputs(double s) {
    for (int k : p_.moving) e_.u[k] = p_.inputs[k].sampled() ? in_[k].at(s) : p_.inputs[k].at(t_ + s);
    e_.move_inputs();
}

// Everything at the start of a step, with the inputs of this step.
void Integrator::start(bool first) {
    set_stage_inputs(0.0);
    std::copy(T_.begin(), T_.end(), e_.t.begin());
    if (!massless_.nodes.empty()) {
        if (first) massless_.factored = false;
        solve_slaved(massless_, e_);
        std::copy(e_.t.begin(), e_.t.begin() + n_, T_.begin());
    }
    e_.rows();
    e_.slopes(J0_.data());
    for (int i = 0; i < n_; ++i) {
        F_[i] = cap_[i] > 0.0 ? e_.f[i] : 0.0;
        if (!std::isfinite(e_.f[i])) throw Failure{NON_FINITE, i};
    }
    for (const auto& [node, own] : holds_) F_[own] += e_.f[node];
    for (int i = 0; i < n_; ++i) d0_[i] = cap_[i] > 0.0 ? F_[i] / cap_[i] : 0.0;
    if (!massless_.nodes.empty()) factor_slaved(massless_, J0_.data());
    make_slaved(quick_, 1e-2);
    if (!quick_.nodes.empty()) factor_slaved(quick_, J0_.data());
    std::copy(e_.u.begin(), e_.u.end(), u0_.begin());
    std::fill(g_.begin(), g_.end(), 0.0);
    if (nk_ > 0) {
        e_.input_slopes(pushes_, other_u_, load_u_, fu_.data());
        for (int k : p_.moving) {
            uder0_[k] = p_.inputs[k].sampled() ? in_[k].slope(0.0) : p_.inputs[k].slope(t_);
            if (uder0_[k] != 0.0) axpy(g_.data(), uder0_[k], fu_.data() + static_cast<size_t>(k) * n_, n_);
        }
    }
    rate(quick_, J0_.data(), g_.data(), d0_.data(), dd0_.data());
}

void Integrator::start_sensitivity() {
    slaved_sensitivity(massless_, e_, S_.data());
    heat_sensitivity(J0_.data(), S_.data(), FS_.data());
    CS_ = S_;
    scale_rows(CS_.data(), cap_.data(), n_, np_);
}

// Derivatives of the heats into nodes with capacity, where the evaluation stands.
void Integrator::heat_sensitivity(const double* j, const double* S, double* fs) {
    p_.pattern.times(j, S, fs, np_);
    e_.add_parameters(parameters_, fs, 1.0);
    for (int i : massless_.nodes) std::fill(fs + i * static_cast<size_t>(np_), fs + (i + 1) * static_cast<size_t>(np_), 0.0);
}

void Integrator::iteration_matrix(const double* j) {
    shifted(lu_.data(), cap_at_.data(), h_ * GAMMA, j, p_.pattern.size());
    ++r_->factorisations;
    const int bad = lu_.factor();
    if (bad >= 0) throw Failure{cap_[bad] > 0.0 ? NEWTON_FAILED : SINGULAR_NODE, bad};
}

// Where the stage would end if every law kept the slopes it has at the start, but for what the stages before found beyond these:
// (C - h gamma J) (T - T_n) = base + h gamma (f_0 + f_u du + beyond).
void Integrator::guess(int s) {
    const size_t n = n_;
    double* beyond = beyond_.data() + s * n;
    std::fill(beyond, beyond + n, 0.0);
    for (int j = 1; j < s; ++j)
        if (const double w = BEYOND[s][j]; w != 0.0) axpy(beyond, w, beyond_.data() + j * n, n_);
    std::copy(beyond, beyond + n, guess_.begin());
    for (int k : p_.moving)
        if (const double du = e_.u[k] - u0_[k]; du != 0.0) axpy(guess_.data(), du, fu_.data() + k * n, n_);
    for (int i = 0; i < n_; ++i) guess_[i] = base_[i] + h_ * GAMMA * (F_[i] + guess_[i]);
    lu_.solve(guess_.data());
    for (int i = 0; i < n_; ++i) e_.t[i] = T_[i] + guess_[i];
}

bool Integrator::newton(int s) {
    // Well below what a step may err, since the heat balance and the derivatives see it too. [K]
    const double close = std::min(1e-7, std::max(2e-10, 1e-2 * tolerance()));
    const double* f = e_.f.data();
    double *beyond = beyond_.data() + static_cast<size_t>(s) * n_, last = 0.0;
    bool fresh = false;
    for (int it = 0; it < 60; ++it) {
        e_.rows();
        ++r_->newton;
        double check = 0.0;
        residual(delta_.data(), cap_.data(), e_.t.data(), T_.data(), base_.data(), h_ * GAMMA, f, n_);
        for (int i = 0; i < n_; ++i) check += delta_[i];
        if (!std::isfinite(check)) return false;
        if (it == 0)
            for (int i = 0; i < n_; ++i) beyond[i] -= delta_[i] / (h_ * GAMMA);
        if (fresh) {
            e_.slopes(J1_.data());
            iteration_matrix(J1_.data());
        }
        lu_.solve(delta_.data());
        double size = 0.0;
        // Full steps may hop to and fro over the corner of a clamped law; half ones end there.
        if (it > 8)
            for (int i = 0; i < n_; ++i) delta_[i] *= 0.5;
        for (int i = 0; i < n_; ++i) {
            e_.t[i] -= delta_[i];
            size = std::max(size, std::fabs(delta_[i]));
        }
        if (!std::isfinite(size) || size > 1e6) return false;
        last_size_ = size;
        double rate = curved_ ? std::max(rho_, 5e-3) : rho_;  // a law may bend where the steps before met none
        if (it > 0 && last > 1e-10) rho_ = std::min(0.9, rate = std::max(size, 1e-12) / last);
        if (size <= 1e-13 || 4.0 * std::min(rate, 0.9) * size <= close || size <= 0.1 * close) return true;
        fresh = it > 0 && rate > 0.05;
        if (it > 3 && rate > 1.5 && !fresh) return false;
        last = size;
    }
    return false;
}

// Heats of the stage, at the converged temperatures, into the integrator's own quadrature.
void Integrator::add_energy(int s, bool updated) {
    const double w = WEIGHT[s];
    if (w == 0.0) return;
    if (updated) {
        e_.shift(w, delta_.data(), acc_con_.data(), acc_load_.data());
        return;
    }
    axpy(acc_con_.data(), w, e_.q.data(), p_.con.size());
    axpy(acc_load_.data(), w, e_.power.data(), p_.load.size());
}

void Integrator::stage_sensitivity(int s) {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    const double hg = h_ * GAMMA;
    const double* from[STAGES + 1] = {CS_.data()};
    double w[STAGES + 1] = {1.0};
    int k = 1;
    for (int j = 0; j < s; ++j)
        if (A[s][j] != 0.0) {
            from[k] = FS_.data() + j * m;
            w[k++] = h_ * A[s][j];
        }
    combine(comb_.data(), from, w, k, static_cast<int>(m));
    for (int i = 0; i < n_; ++i) guess_[i] = cap_[i] > 0.0 ? e_.t[i] - T_[i] : 0.0;
    capacity_term(comb_.data(), guess_.data(), -1.0);
    S1_ = comb_;
    for (int i : massless_.nodes) std::fill(S1_.begin() + i * np, S1_.begin() + (i + 1) * np, 0.0);
    e_.add_parameters(parameters_, S1_.data(), hg);
    lu_.solve_many(S1_.data(), np_);
    double* fs = FS_.data() + s * m;
    for (int i = 0; i < n_; ++i) {
        xa_[i] = cap_[i] / hg;
        guess_[i] = cap_[i] > 0.0 ? 1.0 / hg : 0.0;
    }
    difference(fs, xa_.data(), S1_.data(), guess_.data(), comb_.data(), n_, np_);
}

// The tie between a massless node and what holds its heat makes microwatts of the rounding of a temperature: what is left at such a node goes where
// its heat is held, so that the balance closes.
void Integrator::pass_on() {
    e_.rows();
    for (const auto& [node, own] : holds_) e_.t[own] = T_[own] + inv_cap_[own] * (base_[own] + h_ * GAMMA * (e_.f[own] + e_.f[node]));
}

bool Integrator::stages() {
    const size_t n = n_;
    std::fill(acc_con_.begin(), acc_con_.end(), 0.0);
    std::fill(acc_load_.begin(), acc_load_.end(), 0.0);
    const bool heats_wanted = o_.energy || closes_;
    if (heats_wanted) add_energy(0, false);
    iteration_matrix(J0_.data());
    for (int s = 1; s < STAGES; ++s) {
        const double* from[STAGES];
        double w[STAGES];
        for (int j = 0; j < s; ++j) {
            from[j] = F_.data() + j * n;  // none into nodes without capacity
            w[j] = h_ * A[s][j];
        }
        combine(base_.data(), from, w, s, n_);
        set_stage_inputs(NODE[s] * h_);
        guess(s);
        if (!newton(s)) return false;
        if (!holds_.empty()) pass_on();
        heats(F_.data() + s * n, cap_.data(), e_.t.data(), T_.data(), base_.data(), h_ * GAMMA, n_);
        // The rows stand at the last iterate; heats and derivatives are wanted at the solution.
        const bool again = holds_.empty() && last_size_ > (np_ == 0 ? 1e-5 : leftover_ ? 0.02 * tolerance() : 1e-9) && (np_ > 0 || (heats_wanted && curved_));
        if (again) e_.rows();
        if (heats_wanted) add_energy(s, !again && holds_.empty());
        if (np_ > 0) {
            if (!constant_) {
                e_.slopes(J1_.data());
                iteration_matrix(J1_.data());
            }
            rho_ = std::min(rho_, 0.05);
            stage_sensitivity(s);
        }
    }
    std::copy(e_.t.begin(), e_.t.begin() + n_, T1_.begin());
    return true;
}

}  // namespace thermid
