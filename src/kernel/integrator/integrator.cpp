// A run from its set-up to its results; its steps are those of control.cpp.
#include "integrator/integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thermid {

Integrator::Integrator(const Problem& p, const double* coef, const CoefJacobian& d, const Options& o, LeastSquares* squares)
    : setup_(p, coef, d, o, squares), state_(setup_), step_(setup_), slaved_(setup_, step_), errors_(setup_, state_, step_, slaved_),
      stages_(setup_, state_, step_, slaved_, errors_), outputs_(setup_, state_, step_, slaved_, errors_, stages_), p_(p), coef_(coef), d_(d), o_(o), n_(setup_.n),
      np_(setup_.np), nk_(setup_.nk), when_(np_, 0.0) {
    outputs_.need_u = !p.guards.empty();  // guards are looked at before the first output is
    for (const Guard& g : p.guards)
        for (int i : g.of.node) {
            sensor_boundary_ = sensor_boundary_ || i >= n_;
            sensor_slaved_ = sensor_slaved_ || (i >= 0 && i < n_);
        }
}

int Integrator::worst(const std::vector<double>& v) const {
    int at = 0;
    for (int i = 1; i < n_; ++i)
        if (!(std::fabs(v[i]) <= std::fabs(v[at]))) at = i;
    return at;
}

// The range of temperatures so far scales rtol: a relative error in kelvin would mean nothing.
void Integrator::seen() {
    for (int i = 0; i < p_.nodes(); ++i) {
        if (p_.is_state(i)) continue;
        const double t = i < n_ ? state_.T[i] : step_.e.t[i];
        state_.low = std::min(state_.low, t);
        state_.high = std::max(state_.high, t);
    }
}

void Integrator::check_state() {
    for (int i = 0; i < n_; ++i) {
        if (!std::isfinite(step_.T1[i])) throw Failure{NON_FINITE, i};
        if (p_.is_state(i) || (step_.T1[i] > COLDEST && step_.T1[i] < 1e5)) continue;
        if (!(state_.T[i] > COLDEST && state_.T[i] < 1e5)) throw beyond(p_, i, step_.T1[i]);  // a massless node that has stood there since the start
        for (int k = 0; k < n_; ++k) step_.err[k] = step_.T1[k] - state_.T[k];
        throw Failure{RUN_AWAY, worst(step_.err)};
    }
}

void Integrator::underflow(int cause) const {
    // Growth that feeds itself: a node that warms and whose heat rises with its own temperature.
    int node = -1;
    for (int i = 0; i < n_; ++i)
        if (setup_.cap[i] > 0.0 && step_.J0[p_.pattern.diag[i]] > 0.0 && step_.d0[i] > 0.0 && (node < 0 || step_.d0[i] > step_.d0[node])) node = i;
    if (node >= 0) throw Failure{RUN_AWAY, node};
    throw Failure{cause, worst(cause == STEP_UNDERFLOW ? step_.err : step_.delta)};
}

// Initial temperatures of massless nodes, thermostats and the outputs at the start.
void Integrator::initial(const double* s0, OutputList& out) {
    for (int i = 0; i < n_; ++i) {
        if (!std::isfinite(state_.T[i]) || !(state_.T[i] >= 0.0 || p_.is_state(i))) throw Failure{BAD_INPUT, i};
        if (p_.capacity[i] >= 0 && !(setup_.cap[i] > 0.0 && std::isfinite(setup_.cap[i]))) throw Failure{BAD_INPUT, i};
    }
    for (int j = 0; j < p_.nc; ++j)
        if (!std::isfinite(coef_[j])) throw Failure{BAD_INPUT, -1};
    for (int k = 0; k < nk_; ++k) outputs_.view.u[k] = p_.inputs[k].at(state_.t);
    outputs_.view.set_inputs();
    for (int k = n_; k < p_.nodes(); ++k)
        if (!(outputs_.view.t[k] >= 0.0) || !std::isfinite(outputs_.view.t[k])) throw Failure{BAD_INPUT, k};
    std::copy(state_.T.begin(), state_.T.end(), outputs_.view.t.begin());
    if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, outputs_.view);
    std::fill(state_.entered.begin(), state_.entered.end(), state_.t);
    if (np_ > 0 && s0) std::copy(s0, s0 + state_.S.size(), state_.S.begin());
    if (!p_.samplers.empty()) begin_samples();
    if (!p_.guards.empty()) decide();
    std::copy(outputs_.view.t.begin(), outputs_.view.t.begin() + n_, state_.T.begin());
    step_.e.t = outputs_.view.t;
    step_.e.u = outputs_.view.u;
    step_.e.set_inputs();
    state_.low = state_.high = state_.T[0];
    seen();
    if (np_ > 0) slaved_.sensitivity(slaved_.massless, outputs_.view, state_.S.data());
    std::copy(state_.S.begin(), state_.S.end(), step_.S1.begin());
    step_.h = 1.0;
    outputs_.begin();
    slaved_.fast.nodes = slaved_.massless.nodes;
    slaved_.index(slaved_.fast);
    step_.end = state_.t;
    outputs_.emit(out, *r_);
}

void Integrator::run(const double* t0_nodes, const double* s0, double t0, double t_end, const double* out_t, long nout, const int* obs,
                     int nobs, Result& r) {
    r_ = &r;
    state_.t = t0;
    std::copy(t0_nodes, t0_nodes + n_, state_.T.begin());
    OutputList out{out_t, nout, 0, obs, nobs};
    if (o_.turnings) outputs_.turnings.begin(nobs + o_.sums.size(), out_t, nout);
    try {
        initial(s0, out);
        if (t_end > state_.t) advance(t_end, out);
    } catch (const Failure& f) {
        r.status = f.status;
        r.node = f.node;
    }
    r.time = state_.t;
    r.newton = step_.newton;
    r.factorisations = step_.factors.made;
    r.filled = out.next;
    if (o_.turnings) outputs_.turnings.end();
    r.turnings.swap(outputs_.turnings.found);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const size_t first = static_cast<size_t>(out.next) * nobs, last = static_cast<size_t>(nout) * nobs;
    if (r.traces) std::fill(r.traces + first, r.traces + last, nan);
    if (r.sens && np_ > 0) std::fill(r.sens + first * np_, r.sens + last * np_, nan);
    r.final_t = state_.T;
    r.final_s = state_.S;
    r.on.assign(step_.e.on.begin(), step_.e.on.end());
    r.load_energy = state_.E_load;
    r.conductor_energy.assign(state_.E_con.size(), 0.0);
    r.boundary_energy.assign(p_.nb, 0.0);
    for (size_t k = 0; k < state_.E_con.size(); ++k) {
        r.conductor_energy[p_.con.original[k]] = state_.E_con[k];
        if (p_.con.b[k] >= n_) r.boundary_energy[p_.con.b[k] - n_] += state_.E_con[k];
        if (p_.con.a[k] >= n_ && !is(p_.con.kind[k], ONE_WAY)) r.boundary_energy[p_.con.a[k] - n_] -= state_.E_con[k];
    }
}

void Integrator::begin(const double* nodes, double t, const double* entered, Result& r) {
    r_ = &r;
    state_.t = t;
    std::copy(nodes, nodes + n_, state_.T.begin());
    OutputList none{nullptr, 0, 0, nullptr, 0};
    initial(nullptr, none);
    std::copy(entered, entered + state_.entered.size(), state_.entered.begin());
    in_parts_ = true;
}

void Integrator::go_on(double to, double horizon) {
    OutputList none{nullptr, 0, 0, nullptr, 0};
    asked_ = to;
    if (beyond_ && to >= step_.end) {
        beyond_ = false;
        take(none, wish_);
    }
    if (!beyond_ && to > state_.t) advance(std::max(to, horizon), none);
    if (!beyond_) return;
    outputs_.need_u = true;
    outputs_.nodes_at(to - state_.t, to, true);
}

void Integrator::renew() {
    if (beyond_) {
        std::copy(temperatures(), temperatures() + n_, state_.T.begin());
        state_.t = asked_;
        beyond_ = false;
        pending_ = -1;
    }
    step_.e.renew();
    outputs_.view.renew();
    setup_.take_capacities();
    step_.e.set_inputs();
    outputs_.view.set_inputs();
    first_ = true;
}

}  // namespace thermid
