// A run from its set-up to its results; its steps are those of control.cpp.
#include "integrator/integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace thermid {

Integrator::Integrator(const Problem& p, const double* coef, const CoefJacobian& d, const Options& o, LeastSquares* squares)
    : p_(p), coef_(coef), d_(d), o_(o), squares_(squares), n_(p.n), np_(d.np), nk_(static_cast<int>(p.inputs.size())), e_(p, coef), eo_(p, coef), second_(p) {
    if (n_ > Problem::LARGEST) throw std::invalid_argument("this integrator takes at most " + std::to_string(Problem::LARGEST) + " unknown nodes");
    const size_t n = n_, np = np_, m = n * np, rows = p.con.size(), loads = p.load.size();
    auto moves = [&](int c) { return p.coef_input[c] >= 0 && p.inputs[p.coef_input[c]].kind != CONSTANT; };
    for (const Entry& e : p.con_entry) {
        if (d.any(e.coef)) parameters_.con.push_back(e);
        if (!moves(e.coef)) continue;
        con_u_.push_back(e);
        if (e.what >= 4) e_.pushes_of(e, pushes_);
        else other_u_.push_back(e);
    }
    for (const Entry& e : p.load_entry) {
        // Thresholds act through the switching instant only.
        if (e.what > 4 && p.control.kind[p.load.control[e.row]] == THERMOSTAT) continue;
        if (d.any(e.coef)) parameters_.load.push_back(e);
        if (moves(e.coef)) load_u_.push_back(e);
    }
    parameters_.build(p, d);
    faint_.assign(np, std::numeric_limits<double>::infinity());
    for (size_t c = 0; np > 0 && c + 1 < d.indptr.size(); ++c)
        for (int k = d.indptr[c]; k < d.indptr[c + 1]; ++k)
            if (coef[c] != 0.0) faint_[d.indices[k]] = std::min(faint_[d.indices[k]], std::fabs(d.data[k] / coef[c]));
    for (double& each : faint_)
        if (!std::isfinite(each)) each = 0.0;
    for (int k : p.con.kind) curved_ |= !is(k, STRAIGHT);
    for (int k : p.load.kind) curved_ |= k != SIGNAL;
    for (int k : p.control.kind) curved_ |= k != THERMOSTAT;
    curved_ |= !p.followers.empty();
    constant_ = !curved_ && std::all_of(con_u_.begin(), con_u_.end(), [](const Entry& e) { return e.what >= 4; });
    for (auto* v : {&cap_, &inv_cap_}) v->assign(n, 0.0);
    cap_at_.assign(p.pattern.size(), 0.0);
    take_capacities();
    for (int i = 0; i < n_; ++i)
        if (p.capacity[i] >= 0 && d.any(p.capacity[i])) sought_.push_back(i);
    for (auto* v : {&T_, &T1_, &d0_, &d1_, &dd0_, &dd1_, &base_, &bend_, &drift_, &drift_next_, &guess_, &err_, &shed_[0], &shed_[1], &g_, &dir_, &bb_, &xa_, &felt_}) v->assign(n, 0.0);
    for (auto* v : {&S_, &S1_, &CS_, &comb_, &sd0_, &sd1_, &sdd0_, &sdd1_, &G_, &dirS_, &fp_, &SO_}) v->assign(m, 0.0);
    delta_.assign(p.nodes(), 0.0);  // boundaries stay where they are
    for (auto* v : {&F_, &beyond_}) v->assign(STAGES * n, 0.0);
    FS_.assign(STAGES * m, 0.0);
    poly_.assign(STAGES * n, 0.0);
    for (auto* v : {&J0_, &J1_, &dJ_, &row_}) v->assign(p.pattern.size(), 0.0);
    for (auto* v : {&worst_, &uder0_, &uder1_, &unit_, &u0_}) v->assign(nk_, 0.0);
    fu_.assign(nk_ * n, 0.0);
    in_.resize(nk_);
    hint_.assign(nk_, -1);
    cursor_.resize(nk_);
    noise_.resize(nk_);
    for (int k = 0; k < nk_; ++k) {
        if (!p.inputs[k].sampled()) continue;
        for (auto* v : {&noise_[k].b, &noise_[k].ab, &noise_[k].aab, &noise_[k].db, &noise_[k].c}) v->assign(n, 0.0);
        for (auto* v : {&noise_[k].sb, &noise_[k].sc}) v->assign(m, 0.0);
    }
    lu_.resize(p.pattern, p.elimination);
    for (auto* v : {&acc_con_, &E_con_}) v->assign(rows, 0.0);
    for (auto* v : {&acc_load_, &E_load_}) v->assign(loads, 0.0);
    when_.assign(np, 0.0);
    massless_.nodes = p.massless;
    massless_begin_.assign(1, 0);
    for (int i = 0; i < n_; ++i) {
        for (int k = p.pattern.begin[i]; cap_[i] > 0.0 && k < p.pattern.begin[i + 1]; ++k) {
            const int m = p.pattern.col[k], back = cap_[m] == 0.0 ? p.pattern.at(m, i) : p.pattern.size();
            if (back < p.pattern.size()) massless_at_.insert(massless_at_.end(), {k, back, p.pattern.diag[m]});
        }
        massless_begin_.push_back(static_cast<int>(massless_at_.size()));
    }
    index_slaved(massless_);
    holds_ = p.holds();
    closes_ = !constant_ && holds_.empty();
    need_u_ = !p.guards.empty();  // guards are looked at before the first output is
    for (const Guard& g : p.guards)
        for (int i : g.of.node) {
            sensor_boundary_ = sensor_boundary_ || i >= n_;
            sensor_slaved_ = sensor_slaved_ || (i >= 0 && i < n_);
        }
    entered_.assign(p.switches(), 0.0);
    entered_s_.assign(p.switches() * np, 0.0);
    sampled_.assign(p.samplers.size(), 0);
}

void Integrator::take_capacities() {
    for (int i = 0; i < n_; ++i) {
        if (p_.capacity[i] < 0) continue;
        cap_[i] = coef_[p_.capacity[i]];
        inv_cap_[i] = 1.0 / cap_[i];
        cap_at_[p_.pattern.diag[i]] = cap_[i];
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
        const double t = i < n_ ? T_[i] : e_.t[i];
        low_ = std::min(low_, t);
        high_ = std::max(high_, t);
    }
}

void Integrator::check_state() {
    for (int i = 0; i < n_; ++i) {
        if (!std::isfinite(T1_[i])) throw Failure{NON_FINITE, i};
        if (p_.is_state(i) || (T1_[i] > COLDEST && T1_[i] < 1e5)) continue;
        if (!(T_[i] > COLDEST && T_[i] < 1e5)) throw beyond(p_, i, T1_[i]);  // a massless node that has stood there since the start
        for (int k = 0; k < n_; ++k) err_[k] = T1_[k] - T_[k];
        throw Failure{RUN_AWAY, worst(err_)};
    }
}

void Integrator::underflow(int cause) const {
    // Growth that feeds itself: a node that warms and whose heat rises with its own temperature.
    int node = -1;
    for (int i = 0; i < n_; ++i)
        if (cap_[i] > 0.0 && J0_[p_.pattern.diag[i]] > 0.0 && d0_[i] > 0.0 && (node < 0 || d0_[i] > d0_[node])) node = i;
    if (node >= 0) throw Failure{RUN_AWAY, node};
    throw Failure{cause, worst(cause == STEP_UNDERFLOW ? err_ : delta_)};
}

// Initial temperatures of massless nodes, thermostats and the outputs at the start.
void Integrator::initial(const double* s0, Outputs& out) {
    for (int i = 0; i < n_; ++i) {
        if (!std::isfinite(T_[i]) || !(T_[i] >= 0.0 || p_.is_state(i))) throw Failure{BAD_INPUT, i};
        if (p_.capacity[i] >= 0 && !(cap_[i] > 0.0 && std::isfinite(cap_[i]))) throw Failure{BAD_INPUT, i};
    }
    for (int j = 0; j < p_.nc; ++j)
        if (!std::isfinite(coef_[j])) throw Failure{BAD_INPUT, -1};
    for (int k = 0; k < nk_; ++k) eo_.u[k] = p_.inputs[k].at(t_);
    eo_.set_inputs();
    for (int k = n_; k < p_.nodes(); ++k)
        if (!(eo_.t[k] >= 0.0) || !std::isfinite(eo_.t[k])) throw Failure{BAD_INPUT, k};
    std::copy(T_.begin(), T_.end(), eo_.t.begin());
    if (!massless_.nodes.empty()) solve_slaved(massless_, eo_);
    std::fill(entered_.begin(), entered_.end(), t_);
    if (np_ > 0 && s0) std::copy(s0, s0 + S_.size(), S_.begin());
    if (!p_.samplers.empty()) begin_samples();
    if (!p_.guards.empty()) decide();
    std::copy(eo_.t.begin(), eo_.t.begin() + n_, T_.begin());
    e_.t = eo_.t;
    e_.u = eo_.u;
    e_.set_inputs();
    low_ = high_ = T_[0];
    seen();
    if (np_ > 0) {
        slaved_sensitivity(massless_, eo_, S_.data());
    }
    // Outputs at the start: a step of no length.
    std::copy(T_.begin(), T_.end(), poly_.begin());
    std::copy(S_.begin(), S_.end(), S1_.begin());
    h_ = 1.0;
    for (int k = 0; k < nk_; ++k)
        if (p_.inputs[k].sampled()) cursor_[k].begin(&p_.inputs[k], t_);
    fast_.nodes = massless_.nodes;
    index_slaved(fast_);
    end_ = t_;
    emit(out);
}

void Integrator::run(const double* t0_nodes, const double* s0, double t0, double t_end, const double* out_t, long nout, const int* obs,
                     int nobs, Result& r) {
    r_ = &r;
    t_ = t0;
    std::copy(t0_nodes, t0_nodes + n_, T_.begin());
    Outputs out{out_t, nout, 0, obs, nobs};
    for (int i = 0; i < n_; ++i) all_.push_back(i);
    if (o_.turnings) turnings_.begin(nobs + o_.sums.size(), out_t, nout);
    try {
        initial(s0, out);
        if (t_end > t_) advance(t_end, out);
    } catch (const Failure& f) {
        r.status = f.status;
        r.node = f.node;
    }
    r.time = t_;
    r.filled = out.next;
    if (o_.turnings) turnings_.end();
    r.turnings.swap(turnings_.found);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const size_t first = static_cast<size_t>(out.next) * nobs, last = static_cast<size_t>(nout) * nobs;
    if (r.traces) std::fill(r.traces + first, r.traces + last, nan);
    if (r.sens && np_ > 0) std::fill(r.sens + first * np_, r.sens + last * np_, nan);
    r.final_t = T_;
    r.final_s = S_;
    r.on.assign(e_.on.begin(), e_.on.end());
    r.load_energy = E_load_;
    r.conductor_energy.assign(E_con_.size(), 0.0);
    r.boundary_energy.assign(p_.nb, 0.0);
    for (size_t k = 0; k < E_con_.size(); ++k) {
        r.conductor_energy[p_.con.original[k]] = E_con_[k];
        if (p_.con.b[k] >= n_) r.boundary_energy[p_.con.b[k] - n_] += E_con_[k];
        if (p_.con.a[k] >= n_ && !is(p_.con.kind[k], ONE_WAY)) r.boundary_energy[p_.con.a[k] - n_] -= E_con_[k];
    }
}

void Integrator::begin(const double* nodes, double t, const double* entered, Result& r) {
    r_ = &r;
    t_ = t;
    std::copy(nodes, nodes + n_, T_.begin());
    for (int i = 0; i < n_; ++i) all_.push_back(i);
    Outputs none{nullptr, 0, 0, nullptr, 0};
    initial(nullptr, none);
    std::copy(entered, entered + entered_.size(), entered_.begin());
    in_parts_ = true;
}

void Integrator::go_on(double t_end) {
    Outputs none{nullptr, 0, 0, nullptr, 0};
    if (t_end > t_) advance(t_end, none);
}

void Integrator::renew() {
    e_.renew();
    eo_.renew();
    take_capacities();
    e_.set_inputs();
    eo_.set_inputs();
    first_ = true;
}

}  // namespace thermid
