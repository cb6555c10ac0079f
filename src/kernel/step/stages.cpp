// The stages of one step: Newton in stage values, and the exact derivative of the converged scheme.
//   C (T_s - T_n) = h sum_j a_sj f(T_j) for nodes with capacity, f(T_s) = 0 for those without.
#include <algorithm>
#include <cmath>

#include "step/stages.hpp"

namespace thermid {

namespace {
// Extrapolates to each stage what a smooth law leaves beyond its tangent, tau^2 (a + b tau), from the two latest instants before it.
constexpr double NEAR = 1e-4;  // accuracy of a change by Newton's method: the next one sees what it leaves

constexpr double BEYOND[STAGES][STAGES] = {{0.0}, {0.0}, {0.0, 0.440896}, {0.0, 2.636, -2.4911}, {0.0, 0.0, -5.2349, 3.3805}, {0.0, 0.0, 0.0, -1.6966, 2.2859}};
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

Stages::Stages(Setup& setup, State& state, Step& step, Slaved& slaved, Errors& errors)
    : setup_(setup), state_(state), step_(step), slaved_(slaved), errors_(errors), p_(setup.p), o_(setup.o), n_(setup.n), np_(setup.np), nk_(setup.nk) {
    for (auto* v : {&base_, &guess_, &g_, &xa_}) v->assign(n_, 0.0);
    for (auto* v : {&CS_, &comb_}) v->assign(static_cast<size_t>(n_) * np_, 0.0);
}

void Stages::project() {
    step_.leftover = false;
    for (int k = 0; k < nk_; ++k) {
        step_.worst[k] = 0.0;
        if (!p_.inputs[k].sampled()) continue;
        step_.worst[k] = step_.in[k].project(p_.inputs[k], state_.t, step_.end, step_.hint[k]);
        step_.leftover = step_.leftover || !step_.in[k].exact;
    }
}

void Stages::set_inputs(double s) {
    for (int k : p_.moving) step_.e.u[k] = p_.inputs[k].sampled() ? step_.in[k].at(s) : p_.inputs[k].at(state_.t + s);
    step_.e.move_inputs();
}

// Everything at the start of a step, with the inputs of this step.
void Stages::start(bool first) {
    set_inputs(0.0);
    std::copy(state_.T.begin(), state_.T.end(), step_.e.t.begin());
    if (!slaved_.massless.nodes.empty()) {
        if (first) slaved_.massless.factored = false;
        slaved_.solve(slaved_.massless, step_.e);
        std::copy(step_.e.t.begin(), step_.e.t.begin() + n_, state_.T.begin());
    }
    step_.e.rows();
    step_.e.slopes(step_.J0.data());
    for (int i = 0; i < n_; ++i) {
        step_.F[i] = setup_.cap[i] > 0.0 ? step_.e.f[i] : 0.0;
        if (!std::isfinite(step_.e.f[i])) throw Failure{NON_FINITE, i};
    }
    for (const auto& [node, own] : setup_.holds) step_.F[own] += step_.e.f[node];
    for (int i = 0; i < n_; ++i) step_.d0[i] = setup_.cap[i] > 0.0 ? step_.F[i] / setup_.cap[i] : 0.0;
    if (!slaved_.massless.nodes.empty()) slaved_.factor(slaved_.massless, step_.J0.data());
    slaved_.make(slaved_.quick, 1e-2);
    if (!slaved_.quick.nodes.empty()) slaved_.factor(slaved_.quick, step_.J0.data());
    std::copy(step_.e.u.begin(), step_.e.u.end(), step_.u0.begin());
    std::fill(g_.begin(), g_.end(), 0.0);
    if (nk_ > 0) {
        step_.e.input_slopes(setup_.pushes, setup_.other_u, setup_.load_u, step_.fu.data());
        for (int k : p_.moving) {
            step_.uder0[k] = p_.inputs[k].sampled() ? step_.in[k].slope(0.0) : p_.inputs[k].slope(state_.t);
            if (step_.uder0[k] != 0.0) axpy(g_.data(), step_.uder0[k], step_.fu.data() + static_cast<size_t>(k) * n_, n_);
        }
    }
    slaved_.rate(slaved_.quick, step_.J0.data(), g_.data(), step_.d0.data(), step_.dd0.data());
}

void Stages::start_sensitivity() {
    slaved_.sensitivity(slaved_.massless, step_.e, state_.S.data());
    heat_sensitivity(step_.J0.data(), state_.S.data(), step_.FS.data());
    CS_ = state_.S;
    scale_rows(CS_.data(), setup_.cap.data(), n_, np_);
}

// Derivatives of the heats into nodes with capacity, where the evaluation stands.
void Stages::heat_sensitivity(const double* j, const double* S, double* fs) {
    p_.pattern.times(j, S, fs, np_);
    step_.e.add_parameters(setup_.parameters, fs, 1.0);
    for (int i : slaved_.massless.nodes) std::fill(fs + i * static_cast<size_t>(np_), fs + (i + 1) * static_cast<size_t>(np_), 0.0);
}

// Where the stage would end if every law kept the slopes it has at the start, but for what the stages before found beyond these:
// (C - h gamma J) (T - T_n) = base + h gamma (f_0 + f_u du + beyond).
void Stages::guess(int s) {
    const size_t n = n_;
    double* beyond = step_.beyond.data() + s * n;
    std::fill(beyond, beyond + n, 0.0);
    for (int j = 1; j < s; ++j)
        if (const double w = BEYOND[s][j]; w != 0.0) axpy(beyond, w, step_.beyond.data() + j * n, n_);
    std::copy(beyond, beyond + n, guess_.begin());
    for (int k : setup_.acting)
        if (const double du = step_.e.u[k] - step_.u0[k]; du != 0.0) axpy(guess_.data(), du, step_.fu.data() + k * n, n_);
    for (int i = 0; i < n_; ++i) guess_[i] = base_[i] + step_.h * GAMMA * (step_.F[i] + guess_[i]);
    step_.factors.solve(guess_.data(), NEAR);
    for (int i = 0; i < n_; ++i) step_.e.t[i] = state_.T[i] + guess_[i];
}

bool Stages::newton(int s) {
    // Well below what a step may err, since the heat balance and the derivatives see it too. [K]
    const double close = std::min(1e-7, std::max(2e-10, 1e-2 * errors_.tolerance()));
    const double* f = step_.e.f.data();
    double *beyond = step_.beyond.data() + static_cast<size_t>(s) * n_, last = 0.0;
    bool fresh = false;
    for (int it = 0; it < 60; ++it) {
        step_.e.rows();
        ++step_.newton;
        if (setup_.constant && step_.factors.kept && step_.factors.exact()) {  // the guess is the solution
            std::fill(step_.delta.begin(), step_.delta.begin() + n_, last_size_ = 0.0);
            return true;
        }
        double check = 0.0;
        residual(step_.delta.data(), setup_.cap.data(), step_.e.t.data(), state_.T.data(), base_.data(), step_.h * GAMMA, f, n_);
        for (int i = 0; i < n_; ++i) check += step_.delta[i];
        if (!std::isfinite(check)) return false;
        if (it == 0)
            for (int i = 0; i < n_; ++i) beyond[i] -= step_.delta[i] / (step_.h * GAMMA);
        if (fresh) {
            step_.e.slopes(step_.J1.data());
            step_.factors.take(step_.h * GAMMA, step_.J1.data());
        }
        step_.factors.solve(step_.delta.data(), NEAR);
        double size = 0.0;
        // Full steps may hop to and fro over the corner of a clamped law; half ones end there.
        if (it > 8)
            for (int i = 0; i < n_; ++i) step_.delta[i] *= 0.5;
        for (int i = 0; i < n_; ++i) {
            step_.e.t[i] -= step_.delta[i];
            size = std::max(size, std::fabs(step_.delta[i]));
        }
        if (!std::isfinite(size) || size > 1e6) return false;
        last_size_ = size;
        double rate = setup_.curved ? std::max(rho_, 5e-3) : rho_;  // a law may bend where the steps before met none
        if (it > 0 && last > 1e-10) rho_ = std::min(0.9, rate = std::max(size, 1e-12) / last);
        if (size <= 1e-13 || 4.0 * std::min(rate, 0.9) * size <= close || size <= 0.1 * close) return true;
        fresh = it > 0 && rate > 0.05;
        if (it > 3 && rate > 1.5 && !fresh) return false;
        last = size;
    }
    return false;
}

// Heats of the stage, at the converged temperatures, into the integrator's own quadrature.
void Stages::add_energy(int s, bool updated) {
    const double w = WEIGHT[s];
    if (w == 0.0) return;
    if (updated) {
        step_.e.shift(w, step_.delta.data(), step_.acc_con.data(), step_.acc_load.data());
        return;
    }
    axpy(step_.acc_con.data(), w, step_.e.q.data(), p_.con.size());
    axpy(step_.acc_load.data(), w, step_.e.power.data(), p_.load.size());
}

void Stages::sensitivity(int s) {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    const double hg = step_.h * GAMMA;
    const double* from[STAGES + 1] = {CS_.data()};
    double w[STAGES + 1] = {1.0};
    int k = 1;
    for (int j = 0; j < s; ++j)
        if (A[s][j] != 0.0) {
            from[k] = step_.FS.data() + j * m;
            w[k++] = step_.h * A[s][j];
        }
    combine(comb_.data(), from, w, k, static_cast<int>(m));
    for (int i = 0; i < n_; ++i) guess_[i] = setup_.cap[i] > 0.0 ? step_.e.t[i] - state_.T[i] : 0.0;
    setup_.capacity_term(comb_.data(), guess_.data(), -1.0);
    step_.S1 = comb_;
    for (int i : slaved_.massless.nodes) std::fill(step_.S1.begin() + i * np, step_.S1.begin() + (i + 1) * np, 0.0);
    step_.e.add_parameters(setup_.parameters, step_.S1.data(), hg);
    step_.factors.solve_many(step_.S1.data(), np_, 1e-2 * errors_.slope_tolerance());
    double* fs = step_.FS.data() + s * m;
    for (int i = 0; i < n_; ++i) {
        xa_[i] = setup_.cap[i] / hg;
        guess_[i] = setup_.cap[i] > 0.0 ? 1.0 / hg : 0.0;
    }
    difference(fs, xa_.data(), step_.S1.data(), guess_.data(), comb_.data(), n_, np_);
}

// The tie between a massless node and what holds its heat makes microwatts of the rounding of a temperature: what is left at such a node goes where
// its heat is held, so that the balance closes.
void Stages::pass_on() {
    step_.e.rows();
    for (const auto& [node, own] : setup_.holds) step_.e.t[own] = state_.T[own] + setup_.inv_cap[own] * (base_[own] + step_.h * GAMMA * (step_.e.f[own] + step_.e.f[node]));
}

bool Stages::solve() {
    const size_t n = n_;
    std::fill(step_.acc_con.begin(), step_.acc_con.end(), 0.0);
    std::fill(step_.acc_load.begin(), step_.acc_load.end(), 0.0);
    step_.factors.take(step_.h * GAMMA, step_.J0.data());
    const bool heats_wanted = o_.energy || errors_.closes();
    if (heats_wanted) add_energy(0, false);
    for (int s = 1; s < STAGES; ++s) {
        const double* from[STAGES];
        double w[STAGES];
        for (int j = 0; j < s; ++j) {
            from[j] = step_.F.data() + j * n;  // none into nodes without capacity
            w[j] = step_.h * A[s][j];
        }
        combine(base_.data(), from, w, s, n_);
        set_inputs(NODE[s] * step_.h);
        guess(s);
        if (!newton(s)) return false;
        if (!setup_.holds.empty()) pass_on();
        heats(step_.F.data() + s * n, setup_.cap.data(), step_.e.t.data(), state_.T.data(), base_.data(), step_.h * GAMMA, n_);
        // The rows stand at the last iterate; heats and derivatives are wanted at the solution.
        const bool again = setup_.holds.empty() && last_size_ > (np_ == 0 ? 1e-5 : step_.leftover ? 0.02 * errors_.tolerance() : 1e-9) && (np_ > 0 || (heats_wanted && setup_.curved));
        if (again) step_.e.rows();
        if (heats_wanted) add_energy(s, !again && setup_.holds.empty());
        if (np_ > 0) {
            if (!setup_.constant) {
                step_.e.slopes(step_.J1.data());
                step_.factors.take(step_.h * GAMMA, step_.J1.data());
            }
            rho_ = std::min(rho_, 0.05);
            sensitivity(s);
        }
    }
    std::copy(step_.e.t.begin(), step_.e.t.begin() + n_, step_.T1.begin());
    return true;
}

}  // namespace thermid
