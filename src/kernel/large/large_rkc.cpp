// RKC2: the stabilised explicit Runge-Kutta-Chebyshev method of second order.
// B. P. Sommeijer, L. F. Shampine, J. G. Verwer, RKC: an explicit solver for parabolic PDEs, J. Comput. Appl. Math. 88 (1998) 315-326,
// doi:10.1016/S0377-0427(97)00219-7. Stages are kept as changes since the start of the step, so that what is constant drops out.
#include <algorithm>
#include <cmath>

#include "large/large.hpp"

namespace thermid {

// Returns the error of the step relative to the tolerance.
double LargeRun::rkc() {
    const double h = h_;
    const double rate = std::max(row_rate() + link_rate_, 1e-300);
    r_->rate = std::max(r_->rate, rate);
    const int s = std::max(2, 1 + static_cast<int>(std::ceil(std::sqrt(1.0 + 1.54 * h * rate))));
    // Chebyshev polynomials and their derivatives at w0 by recursion; b_j, a_j as in the article.
    const double w0 = 1.0 + 2.0 / 13.0 / (static_cast<double>(s) * s);
    std::vector<double> T(s + 1), D(s + 1), DD(s + 1), b(s + 1);
    T[0] = 1.0;
    T[1] = w0;
    D[1] = 1.0;
    for (int j = 2; j <= s; ++j) {
        T[j] = 2.0 * w0 * T[j - 1] - T[j - 2];
        D[j] = 2.0 * T[j - 1] + 2.0 * w0 * D[j - 1] - D[j - 2];
        DD[j] = 4.0 * D[j - 1] + 2.0 * w0 * DD[j - 1] - DD[j - 2];
        b[j] = DD[j] / (D[j] * D[j]);
    }
    b[0] = b[1] = b[2];
    const double w1 = D[s] / DD[s];

    const size_t m = p_.moving, k = energy_.size(), tags = p_.tags;
    std::vector<double> e1(k), e2(k, 0.0);
    auto flux = [&](const RowHeat& r, size_t i) { return i < tags ? r.power[i] : r.outflow[i - tags]; };
    double* z1 = z1_.data();
    double* z2 = z2_.data();
    for (size_t i = 0; i < m; ++i) moving_heat_[i] = start_.heat[i] - p_.constant_heat[i];
    const double first = b[1] * w1 * h;
    for (int i = 0; i < n_; ++i) {
        z1[i] = first * G_[i];
        z2[i] = 0.0;
    }
    for (size_t i = 0; i < k; ++i) e1[i] = first * flux(start_, i);
    double c = w1 * DD[2] / D[2] / (4.0 * w0);  // c_1 = c_2 / T'_2(w0)
    for (int j = 2; j <= s; ++j) {
        const double mu = 2.0 * b[j] * w0 / b[j - 1], nu = -b[j] / b[j - 2], mut = 2.0 * b[j] * w1 / b[j - 1] * h;
        const double gat = -(1.0 - b[j - 1] * T[j - 1]) * mut;
        inputs_at(c * h);
        const bool levels = !p_.stored.empty();
        if (levels) {
            std::copy(z1_.data(), z1_.data() + n_, dT_.data());
            for (int i : p_.stored) dT_[i] = warm(i, T_[i] + z1_[i]) - warm(i, T_[i]);
        }
        const double* at = levels ? dT_.data() : z1_.data();
        for (size_t i = 0; i < m; ++i) rows_.t[i] = start_.t[i] + at[p_.special[i]];
        rows_.evaluate_moving(p_, u_.data());
        if (!levels) {
            p_.links.stage(z1_.data(), z2_.data(), G_.data(), inverse_c_.data(), mu, nu, mut, mut + gat);
        } else {
            p_.links.flow(dT_.data(), w_.data());
            for (int i = 0; i < n_; ++i) z2_[i] = mu * z1_[i] + nu * z2_[i] + mut * inverse_c_[i] * w_[i] + (mut + gat) * G_[i];
        }
        z2 = z2_.data();
        for (size_t i = 0; i < m; ++i) {
            z2[p_.special[i]] += mut * moving_c_[i] * (rows_.heat[i] - moving_heat_[i]);
        }
        for (size_t i = 0; i < k; ++i) e2[i] = mu * e1[i] + nu * e2[i] + mut * flux(rows_, i) + gat * flux(start_, i);
        e1.swap(e2);
        z1_.swap(z2_);
        c = w1 * DD[j] / D[j];
        polled();
    }
    gain_ = e1;
    r_->evaluations += s;
    return rkc_finish();
}

// Ends the step: temperatures and rates at its end, and the estimate 0.8 (y0 - y1) + 0.4 h (f0 + f1).
double LargeRun::rkc_finish() {
    const double* z = z1_.data();
    const double* t = T_.data();
    double* t1 = T1_.data();
    for (int i = 0; i < n_; ++i) t1[i] = t[i] + z[i];
    inputs_at(h_);
    full_rate(T1_, rows_, G1_);
    double worst = 0.0, sum = 0.0;
    for (int i = 0; i < n_; ++i) {
        const double e = std::fabs(-0.8 * z[i] + 0.4 * h_ * (G_[i] + G1_[i]));
        worst = std::max(worst, e);
        sum += e;
    }
    return std::isfinite(sum) ? worst / o_.tolerance : std::numeric_limits<double>::infinity();
}

}  // namespace thermid
