// What a step errs by: estimates of it for temperatures and sensitivities, the part that is taken out, and how much is allowed.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "network/knees.hpp"

namespace thermid {

// Largest scaled error estimate, filtered through the iteration matrix as usual for stiff systems.
double Integrator::error() {
    const size_t n = n_;
    for (int i = 0; i < n_; ++i) {
        double e = 0.0;
        for (int s = 0; s < STAGES; ++s) e += (WEIGHT[s] - EMBEDDED[s]) * F_[s * n + i];
        err_[i] = cap_[i] > 0.0 ? h_ * e : 0.0;
    }
    lu_.solve(err_.data());
    double worst = 0.0;
    for (int i = 0; i < n_; ++i) {
        // A node that follows a projected input at once sees its small jumps between steps; they are gone at the step's end.
        if (cap_[i] == 0.0 || (leftover_ && fast_.is[i])) continue;
        worst = std::max(worst, std::fabs(err_[i]));
    }
    return std::max(worst / tolerance(), np_ > 0 ? sensitivity_error() : 0.0);
}

// By how much the end of the step is off for one watt of heat from node `from` to node `to`, as far as they are unknown, all along the
// step [K/W]. What a massless node gets goes to its neighbours at once.
double Integrator::felt(int from, int to) {
    std::fill(felt_.begin(), felt_.end(), 0.0);
    for (int i : {from, to})
        if (i >= 0 && i < n_) felt_[i] += (i == to ? h_ : -h_);
    lu_.solve(felt_.data());
    double worst = 0.0;
    for (int i = 0; i < n_; ++i)
        if (cap_[i] > 0.0) worst = std::max(worst, std::fabs(felt_[i]));
    return worst;
}

// Whether the step passes no knee of a proportional heater or of a table, or is short enough for it; else `next` is the length to try.
bool Integrator::clear_of_knees(double& next) {
    const double* last = F_.data() + static_cast<size_t>(STAGES - 1) * n_;
    Knee knee;
    auto before = [&](int c) { return c < p_.nc && p_.coef_input[c] >= 0 ? coef_[c] * u0_[p_.coef_input[c]] : e_.ceff[c]; };
    auto sweep = [&](int i) -> Sweep {
        if (i >= n_) {
            const double t0 = before(p_.gain[i - n_]) + before(p_.offset[i - n_]), move = e_.t[i] - t0;
            return {t0, e_.t[i], move, move};
        }
        const double move = T1_[i] - T_[i], c = inv_cap_[i] * h_;
        return {T_[i], T1_[i], c > 0.0 ? c * F_[i] : move, c > 0.0 ? c * last[i] : move};
    };
    const Loads& l = p_.load;
    for (int r : p_.bent_loads) {
        double own[4];
        for (int k = 0; k < 4; ++k) own[k] = e_.ceff[l.c[k][r]];
        const Table* tables = p_.tables.data() + l.table[r];
        auto each = [&] { return felt(-1, l.node[r]); };
        if (LOAD_LAWS[l.kind[r]].tables) knee.table(sweep(l.sensor[r]), *tables, [&] { return std::fabs(own[0]) * each(); });
        const int j = l.control[r];
        if (j < 0 || p_.control.kind[j] != PROPORTIONAL) continue;
        const double power = load<double>(l.kind[r], -1, e_.t[l.sensor[r]], 0.0, own, nullptr, Tables{tables}, true, false).p;
        auto c = [&](int k) { return e_.ceff[p_.control.c[k][j]]; };
        knee.heater(sweep(p_.control.sensor[j]), c(0), c(1), c(2), power, each);
    }
    const Conductors& c = p_.con;
    for (int r : p_.bent_conductors) {
        knee.conductor(c.kind[r], sweep(c.a[r]), sweep(c.b[r]), e_.ceff[c.c0[r]], e_.ceff[c.c1[r]], p_.tables.data() + c.table[r],
                       [&] { return felt(c.a[r], c.b[r]); });
    }
    for (int k : p_.bent_factors) {
        const Factor& x = p_.factors[k];
        Sweep z{0.0, 0.0, 0.0, 0.0};
        z.t0 = z.t1 = e_.ceff[x.of.c0];
        for (int m = 0; m < 3; ++m) {
            if (x.of.node[m] < 0) continue;
            const Sweep s = sweep(x.of.node[m]);
            const double w = e_.ceff[x.of.c[m]];
            z = {z.t0 + w * s.t0, z.t1 + w * s.t1, z.a + w * s.a, z.b + w * s.b};
        }
        auto each = [&] {  // by how much the step's end is off for each unit of the factor
            double sum = 0.0;
            for (size_t f = 0; f < p_.followers.size(); ++f) {
                const Drive& own = p_.followers[f];
                for (size_t i = 0; i < own.factors.size(); ++i)
                    if (own.factors[i] == k)
                        for (size_t j = 0; j < own.nodes.size(); ++j) sum += std::fabs(e_.others(own, i) * e_.pull[f][j]) * felt(-1, own.nodes[j]);
            }
            return sum;
        };
        if (x.kind == LOOKUP) knee.table(z, p_.tables[x.table], each);
        else knee.limits(z, x.low < 0 ? -std::numeric_limits<double>::infinity() : e_.ceff[x.low], e_.ceff[x.high], each);
    }
    double allowed = slack_ * tolerance();
    // A knee does not move with the end of a step, so sensitivities err in proportion to its length.
    if (np_ > 0 && knee.steepest > 0.0) {
        const double ratio = 0.1 * slack_ * slope_tolerance() / (0.25 * knee.steepest);
        if (ratio < 1.0) allowed = std::min(allowed, knee.least * ratio * ratio);
        if (ratio < 1.0) knee.error = std::max(knee.error, 2.0 * allowed);
    }
    if (knee.error <= allowed) return true;
    next = knee.retry(h_, allowed);
    return t_ + next == t_ || next < 1e-9 * std::fabs(t_);
}

constexpr double FAINT = 1e-3;

// Largest error of a step's sensitivities, relative to the effect that a parameter has had.
double Integrator::slope_tolerance() const { return std::min(1e-2, std::max(leftover_ ? 1e-4 : 1e-7, 100.0 * tolerance())); }

// The same for the sensitivities, relative to the largest effect that each parameter has had: where temperatures rest they may still move. What a
// parameter far away has done so far may be any power of time; an error is let be where doubling the parameter would show FAINT of a temperature's.
double Integrator::sensitivity_error() {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    const double* from[STAGES];
    double w[STAGES];
    for (int s = 0; s < STAGES; ++s) {
        from[s] = FS_.data() + s * m;
        w[s] = h_ * (WEIGHT[s] - EMBEDDED[s]);
    }
    combine(G_.data(), from, w, STAGES, static_cast<int>(m));
    reach_.resize(np, 0.0);
    counts_.assign(n_, 1);
    largest(reach_.data(), S1_.data(), counts_.data(), n_, np_);
    for (int i = 0; i < n_; ++i) {
        if (cap_[i] == 0.0) std::fill(G_.begin() + i * np, G_.begin() + (i + 1) * np, 0.0);
        counts_[i] = cap_[i] > 0.0 && !(leftover_ && fast_.is[i]);
    }
    if (leftover_) filter_sensitivity(err_.data(), G_.data());
    else lu_.solve_many(G_.data(), np_);
    double worst = 0.0;
    peak_.assign(np, 0.0);
    largest(peak_.data(), G_.data(), counts_.data(), n_, np_);
    const double felt = FAINT * tolerance() / slope_tolerance();
    for (size_t q = 0; q < np; ++q)
        if (reach_[q] > 0.0) worst = std::max(worst, peak_[q] / std::max(reach_[q], felt * faint_[q]));
    return worst / slope_tolerance();
}

// G becomes the derivatives of e, where (C - h gamma J) e = g and G are those of g: (C - h gamma J) E = G - C_p e. What J and the rates change by
// along e is left out: of the size of an error times a curvature, it does not show in any output's error and would cost a tenth of the run.
void Integrator::filter_sensitivity(const double* e, double* G) {
    capacity_term(G, e, -1.0);
    lu_.solve_many(G, np_);
}

// Takes out of the end of the step what it errs by in fast nodes after a jump of a projected input (see SHED); heats follow, so that the
// balance holds.
void Integrator::improve() {
    const size_t np = np_;
    const double* last = err_.data();
    for (int k = 0; k < 2; ++k) {
        double* e = shed_[k].data();
        for (int i = 0; i < n_; ++i) e[i] = cap_[i] * last[i];
        lu_.solve(e);
        last = e;
    }
    const double *e1 = err_.data(), *e2 = shed_[0].data(), *e3 = shed_[1].data();
    for (int i = 0; i < n_; ++i) {
        T1_[i] -= SHED[0] * (e1[i] - e2[i]) + SHED[1] * (e2[i] - e3[i]);
        delta_[i] = SHED[0] * e2[i] + SHED[1] * e3[i];
    }
    if (o_.energy || closes_) e_.lean(GAMMA, delta_.data(), acc_con_.data(), acc_load_.data());
    if (np_ == 0) return;
    const double *from[2] = {e1, e2}, *to[2] = {e2, e3};
    for (int k = 0; k < 2; ++k) {  // G_ holds the derivatives of e1, then of e2
        const double w = SHED[k] - (k > 0 ? SHED[k - 1] : 0.0);
        add(S1_.data(), -w, G_.data(), static_cast<int>(n_ * np));
        scale_rows(G_.data(), cap_.data(), n_, np_);
        capacity_term(G_.data(), from[k], 1.0);
        filter_sensitivity(to[k], G_.data());
    }
    add(S1_.data(), SHED[1], G_.data(), static_cast<int>(n_ * np));
}

// What Newton leaves in the stages, some nanokelvins, is heat that came from nowhere: the end of the step takes it up, as one more iteration of
// Newton for all stages together, and heats follow. Where the Jacobian is constant nothing is left.
void Integrator::close_balance() {
    std::fill(delta_.begin(), delta_.end(), 0.0);
    const Conductors& c = p_.con;
    for (int r = 0; r < c.size(); ++r) {
        delta_[c.b[r]] += acc_con_[r];
        if (!is(c.kind[r], ONE_WAY)) delta_[c.a[r]] -= acc_con_[r];
    }
    for (int r = 0; r < p_.load.size(); ++r) delta_[p_.load.node[r]] += acc_load_[r];
    std::fill(delta_.begin() + n_, delta_.end(), 0.0);  // boundaries stay where they are
    for (int i = 0; i < n_; ++i) delta_[i] = h_ * delta_[i] - cap_[i] * (T1_[i] - T_[i]);
    lu_.solve(delta_.data());
    for (int i = 0; i < n_; ++i) T1_[i] += delta_[i];
    e_.lean(GAMMA, delta_.data(), acc_con_.data(), acc_load_.data());
}

// The jumps of projected inputs show in the estimate, although improve() takes most of what they do away: no finer than those inputs are
// followed, and finer where sensitivities are wanted, whose errors are up to twice as large. Least squares only take directions from them.
double Integrator::tolerance() const {
    const double tol = o_.atol + o_.rtol * (high_ - low_);
    return leftover_ ? std::max(tol, (np_ > 0 && !squares_ ? 0.25 : 0.32) * o_.input_atol) : tol;
}

}  // namespace thermid
