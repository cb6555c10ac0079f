// What a step errs by: estimates of it for temperatures and sensitivities, the part that is taken out, and how much is allowed.
#include <algorithm>
#include <cmath>

#include "step/errors.hpp"
#include "network/knees.hpp"

namespace thermid {

namespace {
constexpr double ROUGH = 1e-2;   // accuracy of an estimate, relative to it
constexpr double CLOSED = 1e-6;  // of the change that closes the heat balance
constexpr double ROUNDING = 1e-11;  // no finer for switchings: of temperatures near 300 K 6e-14 is noise [K]
}  // namespace

Errors::Errors(Setup& setup, State& state, Step& step, Slaved& slaved)
    : setup_(setup), state_(state), step_(step), slaved_(slaved), p_(setup.p), coef_(setup.coef), o_(setup.o), n_(setup.n), np_(setup.np),
      nk_(setup.nk) {
    for (auto* v : {&shed_[0], &shed_[1], &felt_, &bend_, &dir_, &bb_}) v->assign(n_, 0.0);
    G_.assign(static_cast<size_t>(n_) * np_, 0.0);
}

// Largest scaled error estimate, filtered through the iteration matrix as usual for stiff systems.
double Errors::error() {
    const size_t n = n_;
    for (int i = 0; i < n_; ++i) {
        double e = 0.0;
        for (int s = 0; s < STAGES; ++s) e += (WEIGHT[s] - EMBEDDED[s]) * step_.F[s * n + i];
        step_.err[i] = setup_.cap[i] > 0.0 ? step_.h * e : 0.0;
    }
    step_.factors.solve(step_.err.data(), ROUGH);
    double worst = 0.0;
    for (int i = 0; i < n_; ++i) {
        // A node that follows a projected input at once sees its small jumps between steps; they are gone at the step's end.
        if (setup_.cap[i] == 0.0 || (step_.leftover && slaved_.fast.is[i])) continue;
        worst = std::max(worst, std::fabs(step_.err[i]));
    }
    return std::max(worst / tolerance(), np_ > 0 ? sensitivity_error() : 0.0);
}

// By how much the end of the step is off for one watt of heat from node `from` to node `to`, as far as they are unknown, all along the
// step [K/W]. What a massless node gets goes to its neighbours at once.
double Errors::felt(int from, int to) {
    std::fill(felt_.begin(), felt_.end(), 0.0);
    for (int i : {from, to})
        if (i >= 0 && i < n_) felt_[i] += (i == to ? step_.h : -step_.h);
    step_.factors.solve(felt_.data(), ROUGH);
    double worst = 0.0;
    for (int i = 0; i < n_; ++i)
        if (setup_.cap[i] > 0.0) worst = std::max(worst, std::fabs(felt_[i]));
    return worst;
}

// Whether the step passes no knee of a proportional heater or of a table, or is short enough for it; else `next` is the length to try.
bool Errors::clear_of_knees(double& next) {
    const double* last = step_.F.data() + static_cast<size_t>(STAGES - 1) * n_;
    Knee knee;
    auto before = [&](int c) { return c < p_.nc && p_.coef_input[c] >= 0 ? coef_[c] * step_.u0[p_.coef_input[c]] : step_.e.ceff[c]; };
    auto sweep = [&](int i) -> Sweep {
        if (i >= n_) {
            const double t0 = before(p_.gain[i - n_]) + before(p_.offset[i - n_]), move = step_.e.t[i] - t0;
            return {t0, step_.e.t[i], move, move};
        }
        const double move = step_.T1[i] - state_.T[i], c = setup_.inv_cap[i] * step_.h;
        return {state_.T[i], step_.T1[i], c > 0.0 ? c * step_.F[i] : move, c > 0.0 ? c * last[i] : move};
    };
    const Loads& l = p_.load;
    for (int r : p_.bent_loads) {
        double own[4];
        for (int k = 0; k < 4; ++k) own[k] = step_.e.ceff[l.c[k][r]];
        const Table* tables = p_.tables.data() + l.table[r];
        auto each = [&] { return felt(-1, l.node[r]); };
        if (LOAD_LAWS[l.kind[r]].tables) knee.table(sweep(l.sensor[r]), *tables, [&] { return std::fabs(own[0]) * each(); });
        const int j = l.control[r];
        if (j < 0 || p_.control.kind[j] != PROPORTIONAL) continue;
        const double power = load<double>(l.kind[r], -1, step_.e.t[l.sensor[r]], 0.0, own, nullptr, Tables{tables}, true, false).p;
        auto c = [&](int k) { return step_.e.ceff[p_.control.c[k][j]]; };
        knee.heater(sweep(p_.control.sensor[j]), c(0), c(1), c(2), power, each);
    }
    const Conductors& c = p_.con;
    for (int r : p_.bent_conductors) {
        knee.conductor(c.kind[r], sweep(c.a[r]), sweep(c.b[r]), step_.e.ceff[c.c0[r]], step_.e.ceff[c.c1[r]], p_.tables.data() + c.table[r],
                       [&] { return felt(c.a[r], c.b[r]); });
    }
    for (int k : p_.bent_factors) {
        const Factor& x = p_.factors[k];
        Sweep z{0.0, 0.0, 0.0, 0.0};
        z.t0 = z.t1 = step_.e.ceff[x.of.c0];
        for (int m = 0; m < 3; ++m) {
            if (x.of.node[m] < 0) continue;
            const Sweep s = sweep(x.of.node[m]);
            const double w = step_.e.ceff[x.of.c[m]];
            z = {z.t0 + w * s.t0, z.t1 + w * s.t1, z.a + w * s.a, z.b + w * s.b};
        }
        auto each = [&] {  // by how much the step's end is off for each unit of the factor
            double sum = 0.0;
            for (size_t f = 0; f < p_.followers.size(); ++f) {
                const Drive& own = p_.followers[f];
                for (size_t i = 0; i < own.factors.size(); ++i)
                    if (own.factors[i] == k)
                        for (size_t j = 0; j < own.nodes.size(); ++j) sum += std::fabs(step_.e.others(own, i) * step_.e.pull[f][j]) * felt(-1, own.nodes[j]);
            }
            return sum;
        };
        if (x.kind == LOOKUP) knee.table(z, p_.tables[x.table], each);
        else knee.limits(z, x.low < 0 ? -std::numeric_limits<double>::infinity() : step_.e.ceff[x.low], step_.e.ceff[x.high], each);
    }
    double allowed = step_.slack * tolerance();
    // A knee does not move with the end of a step, so sensitivities err in proportion to its length.
    if (np_ > 0 && knee.steepest > 0.0) {
        const double ratio = 0.1 * step_.slack * slope_tolerance() / (0.25 * knee.steepest);
        if (ratio < 1.0) allowed = std::min(allowed, knee.least * ratio * ratio);
        if (ratio < 1.0) knee.error = std::max(knee.error, 2.0 * allowed);
    }
    if (knee.error <= allowed) return true;
    next = knee.retry(step_.h, allowed);
    return state_.t + next == state_.t || next < 1e-9 * std::fabs(state_.t);
}

constexpr double FAINT = 1e-3;

// Largest error of a step's sensitivities, relative to the effect that a parameter has had.
double Errors::slope_tolerance() const { return std::min(1e-2, std::max(step_.leftover ? 1e-4 : 1e-7, 100.0 * tolerance())); }

// The same for the sensitivities, relative to the largest effect that each parameter has had: where temperatures rest they may still move. What a
// parameter far away has done so far may be any power of time; an error is let be where doubling the parameter would show FAINT of a temperature's.
double Errors::sensitivity_error() {
    const size_t np = np_, m = static_cast<size_t>(n_) * np;
    const double* from[STAGES];
    double w[STAGES];
    for (int s = 0; s < STAGES; ++s) {
        from[s] = step_.FS.data() + s * m;
        w[s] = step_.h * (WEIGHT[s] - EMBEDDED[s]);
    }
    combine(G_.data(), from, w, STAGES, static_cast<int>(m));
    reach_.resize(np, 0.0);
    counts_.assign(n_, 1);
    largest(reach_.data(), step_.S1.data(), counts_.data(), n_, np_);
    for (int i = 0; i < n_; ++i) {
        if (setup_.cap[i] == 0.0) std::fill(G_.begin() + i * np, G_.begin() + (i + 1) * np, 0.0);
        counts_[i] = setup_.cap[i] > 0.0 && !(step_.leftover && slaved_.fast.is[i]);
    }
    if (step_.leftover) filter_sensitivity(step_.err.data(), G_.data());
    else step_.factors.solve_many(G_.data(), np_, ROUGH);
    double worst = 0.0;
    peak_.assign(np, 0.0);
    largest(peak_.data(), G_.data(), counts_.data(), n_, np_);
    const double felt = FAINT * tolerance() / slope_tolerance();
    for (size_t q = 0; q < np; ++q)
        if (reach_[q] > 0.0) worst = std::max(worst, peak_[q] / std::max(reach_[q], felt * setup_.faint[q]));
    return worst / slope_tolerance();
}

// G becomes the derivatives of e, where (C - h gamma J) e = g and G are those of g: (C - h gamma J) E = G - C_p e. What J and the rates change by
// along e is left out: of the size of an error times a curvature, it does not show in any output's error and would cost a tenth of the run.
void Errors::filter_sensitivity(const double* e, double* G) {
    setup_.capacity_term(G, e, -1.0);
    step_.factors.solve_many(G, np_, ROUGH);
}

// Takes out of the end of the step what it errs by in fast nodes after a jump of a projected input (see SHED); heats follow, so that the
// balance holds.
void Errors::improve() {
    const size_t np = np_;
    const double* last = step_.err.data();
    for (int k = 0; k < 2; ++k) {
        double* e = shed_[k].data();
        for (int i = 0; i < n_; ++i) e[i] = setup_.cap[i] * last[i];
        step_.factors.solve(e, ROUGH);
        last = e;
    }
    const double *e1 = step_.err.data(), *e2 = shed_[0].data(), *e3 = shed_[1].data();
    for (int i = 0; i < n_; ++i) {
        step_.T1[i] -= SHED[0] * (e1[i] - e2[i]) + SHED[1] * (e2[i] - e3[i]);
        step_.delta[i] = SHED[0] * e2[i] + SHED[1] * e3[i];
    }
    if (o_.energy || closes()) step_.e.lean(GAMMA, step_.delta.data(), step_.acc_con.data(), step_.acc_load.data());
    if (np_ == 0) return;
    const double *from[2] = {e1, e2}, *to[2] = {e2, e3};
    for (int k = 0; k < 2; ++k) {  // G_ holds the derivatives of e1, then of e2
        const double w = SHED[k] - (k > 0 ? SHED[k - 1] : 0.0);
        add(step_.S1.data(), -w, G_.data(), static_cast<int>(n_ * np));
        scale_rows(G_.data(), setup_.cap.data(), n_, np_);
        setup_.capacity_term(G_.data(), from[k], 1.0);
        filter_sensitivity(to[k], G_.data());
    }
    add(step_.S1.data(), SHED[1], G_.data(), static_cast<int>(n_ * np));
}

// What Newton leaves in the stages, some nanokelvins, is heat that came from nowhere: the end of the step takes it up, as one more iteration of
// Newton for all stages together, and heats follow. Where the Jacobian is constant and its own
// factors are at hand nothing is left. The factors are those of a step of length `factored`.
void Errors::close_balance(double factored) {
    std::fill(step_.delta.begin(), step_.delta.end(), 0.0);
    const Conductors& c = p_.con;
    for (int r = 0; r < c.size(); ++r) {
        step_.delta[c.b[r]] += step_.acc_con[r];
        if (!is(c.kind[r], ONE_WAY)) step_.delta[c.a[r]] -= step_.acc_con[r];
    }
    for (int r = 0; r < p_.load.size(); ++r) step_.delta[p_.load.node[r]] += step_.acc_load[r];
    std::fill(step_.delta.begin() + n_, step_.delta.end(), 0.0);  // boundaries stay where they are
    for (int i = 0; i < n_; ++i) step_.delta[i] = step_.h * step_.delta[i] - setup_.cap[i] * (step_.T1[i] - state_.T[i]);
    step_.factors.solve(step_.delta.data(), CLOSED);
    for (int i = 0; i < n_; ++i) step_.T1[i] += step_.delta[i];
    step_.e.lean(GAMMA * (factored / step_.h), step_.delta.data(), step_.acc_con.data(), step_.acc_load.data());
}

// The jumps of projected inputs show in the estimate, although improve() takes most of what they do away: no finer than those inputs are
// followed, and finer where sensitivities are wanted, whose errors are up to twice as large. Least squares only take directions from them.
// What a step errs by moves the next switching, and the phase of a switch that cycles is not damped: errors of its switchings add up over the whole
// run. The k-th may err by a k-th of what a step may, so that a thousand err by seven times that.
double Errors::tolerance() const {
    const double whole = o_.atol + o_.rtol * (state_.high - state_.low);
    const double tol = std::max(whole / static_cast<double>(1 + state_.most_switched), std::min(whole, ROUNDING));
    return step_.leftover ? std::max(tol, (np_ > 0 && !setup_.squares ? 0.25 : 0.32) * o_.input_atol) : tol;
}

// Prepares the corrections and returns the estimated error of what they neglect, in kelvin.
// dT = (b + s db) w + (A b - db) ww + A A b www; the next term of the series is the estimate.
double Errors::input_error() {
    double total = 0.0;
    slaved_.make(slaved_.fast, step_.leftover ? 1e-4 : 1e-2);
    if (!step_.leftover) {
        for (Noise& z : step_.noise) z.active = false;
        std::copy(state_.drift.begin(), state_.drift.end(), step_.drift_next.begin());
        return 0.0;
    }
    if (!slaved_.fast.nodes.empty()) slaved_.factor(slaved_.fast, step_.J0.data());
    for (int k = 0; k < nk_; ++k) {
        Noise& z = step_.noise[k];
        z.active = p_.inputs[k].sampled() && !step_.in[k].exact && !setup_.idles[k];
        if (!z.active) continue;
        std::fill(dir_.begin(), dir_.end(), 0.0);
        slaved_.rate(slaved_.fast, step_.J0.data(), step_.fu.data() + static_cast<size_t>(k) * n_, dir_.data(), z.b.data());
        bb_ = z.b;
        slaved_.rate(slaved_.fast, step_.J0.data(), nullptr, bb_.data(), z.ab.data());
        dir_ = z.ab;
        slaved_.rate(slaved_.fast, step_.J0.data(), nullptr, dir_.data(), z.aab.data());
        dir_ = z.aab;
        slaved_.rate(slaved_.fast, step_.J0.data(), nullptr, dir_.data(), bb_.data());
        double big = 0.0;
        for (int i = 0; i < n_; ++i) big = std::max(big, std::fabs(bb_[i]));
        total += big * 0.25 * step_.h * step_.worst[k];
    }
    return total + curvature();
}

// What the curvature of the laws at the inputs' boundaries makes of the mean square of what is left over: each node drifts towards
// |f_uu| / 2 |J| of it, with its own time constant. The largest drift at the step's end.
double Errors::curvature() {
    std::fill(bend_.begin(), bend_.end(), 0.0);
    const Conductors& c = p_.con;
    for (const Entry& e : setup_.con_u) {
        const int k = p_.coef_input[e.coef], r = e.row, kind = c.kind[r], node = e.what == 4 ? c.b[r] : c.a[r];
        if (e.what < 4 || is(kind, STRAIGHT) || node >= n_ || !step_.noise[k].active) continue;
        const double g = coef_[e.coef], ta = step_.e.t[c.a[r]], tb = step_.e.t[c.b[r]];
        const auto x = conductor<false, Dual>(kind, Dual(ta, e.what == 4), Dual(tb, e.what == 5), step_.e.ceff[c.c0[r]], step_.e.ceff[c.c1[r]],
                                              p_.tables.data() + c.table[r]);
        const double second = e.what == 4 ? x.qa.e : x.qb.e;  // d^2 q / d end^2
        bend_[node] += 0.5 * std::fabs(second) * g * g * step_.in[k].variance;
    }
    double worst = 0.0;
    for (int i = 0; i < n_; ++i) {
        const double own = step_.h * std::fabs(step_.J0[p_.pattern.diag[i]]);
        // (h / C) bend / (1 + h |J| / C): at once for a massless node, and towards bend / |J|
        step_.drift_next[i] = (setup_.cap[i] * state_.drift[i] + step_.h * bend_[i]) / std::max(setup_.cap[i] + own, 1e-300);
        worst = std::max(worst, step_.drift_next[i]);
    }
    return worst;
}

// Nodes far faster than the step that settle within it: what their settling, over long before the first output, does to the slopes of the
// others at the step's start, and so to the outputs within the step. The temperatures at its end hardly feel it. [K]
double Errors::unsettled() {
    if (slaved_.quick.nodes.size() == slaved_.massless.nodes.size()) return 0.0;
    std::fill(bb_.begin(), bb_.end(), 0.0);
    std::fill(dir_.begin(), dir_.end(), 0.0);
    for (int i : slaved_.quick.nodes) bb_[i] = step_.F[i] - step_.F[(STAGES - 1) * static_cast<size_t>(n_) + i];
    slaved_.rate(slaved_.quick, step_.J0.data(), bb_.data(), dir_.data(), step_.err.data());
    double most = 0.0;
    for (int i = 0; i < n_; ++i) most = std::max(most, 0.15 * step_.h * std::fabs(step_.err[i]));  // a slope weighs s (1 - s)^2 in a cubic
    return most;
}

}  // namespace thermid
