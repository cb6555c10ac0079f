// TR-BDF2, L-stable, of second order, with the error estimate of third order, as a singly diagonal implicit method.
// M. E. Hosea, L. F. Shampine, Analysis and implementation of TR-BDF2, Appl. Numer. Math. 20 (1996) 21-37,
// doi:10.1016/0168-9274(95)00115-8. Stage equations by Newton with conjugate gradients under Jacobi's preconditioner.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "large/large.hpp"

namespace thermid {

namespace {
const double ROOT = std::sqrt(2.0);
const double DIAGONAL = 1.0 - ROOT / 2.0, WEIGHT_1 = ROOT / 4.0, FIRST_PART = 2.0 - ROOT;
constexpr int MOST_NEWTON = 10, MOST_GRADIENTS = 5000;
constexpr int MOST_SWINGING = 30;  // steps of Newton's method where whole ones may swing to and fro
}  // namespace

// y = J x, that of the links and of rows_.
void LargeRun::conduct(const Field& x, std::vector<double>& y) const {
    p_.links.flow(x.data(), y.data());
    for (size_t k = 0; k < p_.special.size(); ++k) y[p_.special[k]] -= rows_.slope[k] * x[p_.special[k]];
    for (const RowGroup& g : p_.rows) {
        if (g.boundary >= 0) continue;
        for (int r = g.begin; r < g.end; ++r) {
            const double q = rows_.pair[r] * (x[p_.a[r]] - x[p_.b[r]]);
            y[p_.a[r]] -= q;
            y[p_.b[r]] += q;
        }
    }
}

// y = (scale C - dh S J S) x. S is one, and of a level the root of dT/d level (see solve_stage).
void LargeRun::apply(const Field& x, double dh, double scale, std::vector<double>& y) {
    if (p_.stored.empty()) {
        conduct(x, y);
        for (int i = 0; i < n_; ++i) y[i] = scale * p_.capacity[i] * x[i] - dh * y[i];
        return;
    }
    for (int i = 0; i < n_; ++i) weighed_[i] = root_[i] * x[i];
    conduct(weighed_, y);
    for (int i = 0; i < n_; ++i) y[i] = scale * p_.capacity[i] * x[i] - dh * root_[i] * y[i];
}

// S at a state.
void LargeRun::spread(const Field& state) {
    for (int i : p_.stored) {
        double slope;
        warm(i, state[i], &slope);
        root_[i] = std::sqrt(std::max(slope, 0.0));
    }
}

// From y = S dH in x_ and the right side in kept_ the changes dH of levels, C dH = kept + dh J S y; they take the place of y.
void LargeRun::levels(double dh) {
    if (p_.stored.empty()) return;
    for (int i = 0; i < n_; ++i) weighed_[i] = root_[i] * x_[i];
    conduct(weighed_, w_);
    for (int i : p_.stored) x_[i] = (kept_[i] + dh * w_[i]) * inverse_c_[i];
}

void LargeRun::matrix_diagonal(double dh, double scale) {
    for (int i = 0; i < n_; ++i) diag_[i] = scale * p_.capacity[i] + dh * link_sum_[i];
    for (size_t k = 0; k < p_.special.size(); ++k) diag_[p_.special[k]] += dh * rows_.slope[k];
    for (const RowGroup& g : p_.rows) {
        if (g.boundary >= 0) continue;
        for (int r = g.begin; r < g.end; ++r) {
            diag_[p_.a[r]] += dh * rows_.pair[r];
            diag_[p_.b[r]] += dh * rows_.pair[r];
        }
    }
    for (int i : p_.stored) diag_[i] = scale * p_.capacity[i] + root_[i] * root_[i] * (diag_[i] - scale * p_.capacity[i]);
}

// Solves (scale C - dh J) x_ = rhs; scale 0 solves the massless nodes alone, the others held. rhs is lost.
// The change that is left has an energy norm of at least (change of one node) sqrt(C); its estimate: Hestenes and Stiefel 1952, delayed.
bool LargeRun::gradients(std::vector<double>& rhs, double dh, double scale, double accuracy) {
    matrix_diagonal(dh, scale);
    const bool held = scale == 0.0;
    double capacity = 0.0, by_links = 0.0;
    for (int i = 0; i < n_; ++i) {
        if (held && p_.capacity[i] > 0.0) diag_[i] = 1.0;  // not solved for
        if (!(diag_[i] > 0.0)) {
            if (diag_[i] == 0.0 && p_.capacity[i] == 0.0) r_->node = i;
            return false;
        }
        capacity += p_.capacity[i];
        if (!held || p_.capacity[i] == 0.0) by_links += diag_[i];
    }
    const double enough = accuracy * accuracy * (scale > 0.0 ? scale * capacity : by_links) / n_;
    double rz = 0.0;
    for (int i = 0; i < n_; ++i) {
        if (held && p_.capacity[i] > 0.0) rhs[i] = 0.0;
        x_[i] = 0.0;
        p1_[i] = z_[i] = rhs[i] / diag_[i];
        rz += rhs[i] * z_[i];
    }
    const double start = rz;
    double recent[4] = {};
    for (int k = 0; k < MOST_GRADIENTS && rz > 0.0; ++k) {
        apply(p1_, dh, scale, w_);
        double pw = 0.0;
        for (int i = 0; i < n_; ++i) {
            if (held && p_.capacity[i] > 0.0) w_[i] = 0.0;
            pw += p1_[i] * w_[i];
        }
        ++r_->iterations;
        polled();
        if (!(pw > 0.0)) return false;
        const double alpha = rz / pw, old = rz;
        recent[k % 4] = alpha * rz;
        rz = 0.0;
        for (int i = 0; i < n_; ++i) {
            x_[i] += alpha * p1_[i];
            rhs[i] -= alpha * w_[i];
            z_[i] = rhs[i] / diag_[i];
            rz += rhs[i] * z_[i];
        }
        if ((k >= 3 && recent[0] + recent[1] + recent[2] + recent[3] < enough) || rz <= 1e-26 * start) return true;
        const double beta = rz / old;
        for (int i = 0; i < n_; ++i) p1_[i] = z_[i] + beta * p1_[i];
    }
    return rz == 0.0;
}

// Solves C (at - T) - dh F(at) = base for `at`, which comes in as a guess; massless nodes: F = 0.
// Of levels H with temperatures f(H), Newton's matrix C - dh J f' is not symmetric; with S = sqrt(f') and y = S dH it becomes
// (C - dh S J S) y = S r, which is, and which f' = 0 does no harm: C dH = r + dh J S y.
bool LargeRun::solve_stage(Field& at, const std::vector<double>& base, double dh) {
    const double fine = 0.01 * o_.tolerance;
    // Where temperature does not move with heat, or nothing is stored, a knee or what the symmetric part leaves out may make whole steps swing.
    const bool plain = p_.stored.empty(), swings = !plain || !massless_.empty();
    double before = 0.0, share = 1.0;
    for (int k = 0; k < (swings ? MOST_SWINGING : MOST_NEWTON); ++k) {
        const Field& t = warm(at);
        gather(rows_, t.data());
        rows_.evaluate(p_, u_.data(), true);
        ++r_->evaluations;
        p_.links.flow(t.data(), r_v_.data());
        spread(at);
        for (size_t i = 0; i < p_.special.size(); ++i) r_v_[p_.special[i]] += rows_.heat[i];
        for (int i = 0; i < n_; ++i)
            r_v_[i] = dh * r_v_[i] + (p_.capacity[i] > 0.0 ? base[i] - p_.capacity[i] * (at[i] - T_[i]) : 0.0);
        if (!plain) {
            kept_ = r_v_;
            for (int i : p_.stored) r_v_[i] *= root_[i];
        }
        if (!gradients(r_v_, dh, 1.0, 0.1 * fine)) return false;
        levels(dh);
        double size = 0.0, sum = 0.0;
        for (int i = 0; i < n_; ++i) {
            size = std::max(size, std::fabs(x_[i]));
            sum += x_[i];
        }
        if (!std::isfinite(sum) || (!swings && k > 1 && size > before)) return false;
        if (swings && k > 1 && size > 0.7 * before) share = std::max(0.5 * share, 0.0625);
        for (int i = 0; i < n_; ++i) at[i] += share * x_[i];
        // Linear networks need one solve; else the next change is about size^2 / before.
        if (linear_ || size < fine || (plain && share == 1.0 && k > 0 && size * size < fine * before)) return true;
        before = size;
    }
    return false;
}

// Returns the error of the step relative to the tolerance.
double LargeRun::trbdf() {
    const double h = h_, dh = DIAGONAL * h, bad = std::numeric_limits<double>::infinity();
    r_->rate = std::max(r_->rate, row_rate() + link_rate_);
    for (int i = 0; i < n_; ++i) {
        heat0_[i] = p_.capacity[i] * G_[i];
        base_[i] = dh * heat0_[i];
        T1_[i] = T_[i] + FIRST_PART * h * G_[i];
    }
    // A long step from a fast start: Euler's guess may lie far off.
    double guess = 0.0;
    for (int i = 0; i < n_; ++i) guess = std::max(guess, std::fabs(T1_[i] - T_[i]));
    if (!(guess < 50.0))
        for (int i = 0; i < n_; ++i) T1_[i] = T_[i];
    std::vector<double> share(energy_.size());
    const size_t tags = p_.tags;
    auto add = [&](const RowHeat& r, double weight) {
        for (size_t i = 0; i < share.size(); ++i) share[i] += weight * (i < tags ? r.power[i] : r.outflow[i - tags]);
    };
    auto settled = [&](std::vector<double>& heat) {  // the stage's heat by its own equation, and its rows at what was found
        for (int i = 0; i < n_; ++i) heat[i] = p_.capacity[i] > 0.0 ? (p_.capacity[i] * (T1_[i] - T_[i]) - base_[i]) / dh : 0.0;
        gather(rows_, warm(T1_).data());
        rows_.evaluate(p_, u_.data(), true);
        spread(T1_);
    };
    add(start_, WEIGHT_1 * h);
    inputs_at(FIRST_PART * h);
    if (!solve_stage(T1_, base_, dh)) return bad;
    settled(heat1_);
    add(rows_, WEIGHT_1 * h);
    for (size_t k = 0; k < massless_.size(); ++k) bend_[k] = T1_[massless_[k]];
    for (int i = 0; i < n_; ++i) {
        base_[i] = WEIGHT_1 * h * (heat0_[i] + heat1_[i]);
        T1_[i] += (1.0 - FIRST_PART) * (T1_[i] - T_[i]) / FIRST_PART;
    }
    inputs_at(h);
    if (!solve_stage(T1_, base_, dh)) return bad;
    settled(heat2_);
    add(rows_, DIAGONAL * h);
    gain_ = share;
    // Error by the embedded formula of third order, filtered by the stage's matrix.
    const double e0 = WEIGHT_1 - (1.0 - WEIGHT_1) / 3.0, e1 = WEIGHT_1 - (3.0 * WEIGHT_1 + 1.0) / 3.0, e2 = DIAGONAL * 2.0 / 3.0;
    double sum = 0.0;
    for (int i = 0; i < n_; ++i) {
        r_v_[i] = h * (e0 * heat0_[i] + e1 * heat1_[i] + e2 * heat2_[i]);
        G1_[i] = heat2_[i] * inverse_c_[i];
        sum += r_v_[i];
    }
    if (!p_.stored.empty()) {
        kept_ = r_v_;
        for (int i : p_.stored) r_v_[i] *= root_[i];
    }
    if (!std::isfinite(sum) || !gradients(r_v_, dh, 1.0, 0.1 * o_.tolerance)) return bad;
    levels(dh);
    double worst = 0.0;
    for (int i = 0; i < n_; ++i) worst = std::max(worst, std::fabs(x_[i]));
    // Massless nodes make no error at the end of a step. Inside it they follow a parabola; a twentieth of its bend is asked to be small,
    // apart from what a projected input may do to its ends.
    for (size_t k = 0; k < massless_.size(); ++k) {
        const double a = T_[massless_[k]], b = T1_[massless_[k]];
        bend_[k] = (bend_[k] - a - (b - a) * FIRST_PART) / (FIRST_PART * (1.0 - FIRST_PART));
        worst = std::max(worst, 0.05 * (std::fabs(bend_[k]) - 4.0 * o_.input_atol));
    }
    return worst / o_.tolerance;
}

// Outputs inside a step: nodes that settle within a hundredth of it follow a parabola through the stages, as massless ones do; their rate at the
// step's start belongs to what was before it.
void LargeRun::draw_parabolas() {
    const double dh = DIAGONAL * h_;
    for (int i = 0; i < n_; ++i) {
        if (!(diag_[i] > (1.0 + 100.0 * DIAGONAL) * p_.capacity[i]) || p_.capacity[i] == 0.0) continue;
        const double step = T1_[i] - T_[i], middle = dh * (heat0_[i] + heat1_[i]) * inverse_c_[i];
        const double bend = (middle - step * FIRST_PART) / (FIRST_PART * (1.0 - FIRST_PART));
        G_[i] = (step + bend) / h_;
        G1_[i] = (step - bend) / h_;
    }
}

void LargeRun::restore_slopes() {
    for (int i = 0; i < n_; ++i)
        if (p_.capacity[i] > 0.0) G1_[i] = heat2_[i] * inverse_c_[i];
}

// Massless nodes at the start, and after a jump of the inputs: F = 0 with the others held.
// The symmetric part of radiation lets whole steps swing by up to three times what was left; a share of them is taken while they do.
bool LargeRun::settle_massless() {
    std::vector<double> before(massless_.size());
    double share = 1.0;
    for (int k = 0; k < 10 * MOST_NEWTON; ++k) {
        const Field& t = warm(T_);
        gather(rows_, t.data());
        rows_.evaluate(p_, u_.data(), true);
        p_.links.flow(t.data(), r_v_.data());
        spread(T_);
        for (size_t i = 0; i < p_.special.size(); ++i) r_v_[p_.special[i]] += rows_.heat[i];
        if (!gradients(r_v_, 1.0, 0.0, 1e-4 * o_.tolerance)) return false;
        double size = 0.0, along = 0.0;
        for (size_t m = 0; m < massless_.size(); ++m) {
            const double step = x_[massless_[m]];
            size = std::max(size, std::fabs(step));
            along += step * before[m];
            before[m] = step;
        }
        share = along < 0.0 ? std::max(0.5 * share, 0.0625) : std::min(2.0 * share, 1.0);
        const double cut = share * (size > 100.0 ? 100.0 / size : 1.0);
        for (int i = 0; i < n_; ++i) T_[i] += cut * x_[i];
        if (size < 1e-3 * o_.tolerance) return true;
        if (!std::isfinite(size)) return false;
    }
    return false;
}

}  // namespace thermid
