#include "linear.hpp"

#include <utility>

namespace thermid {

THERMID_CLONES void combine(double* __restrict out, const double* const* rows, const double* w, int k, int m) {
    for (int i = 0; i < m; ++i) out[i] = w[0] * rows[0][i];
    for (int r = 1; r < k; ++r) {
        const double a = w[r];
        if (a == 0.0) continue;
        const double* __restrict x = rows[r];
        for (int i = 0; i < m; ++i) out[i] += a * x[i];
    }
}

THERMID_CLONES void blend(double* __restrict out, const double* __restrict w, int rows, const double* __restrict x, int k, int m) {
    constexpr int W = 8;
    for (int j0 = 0; j0 < m; j0 += W) {
        const int len = m - j0 < W ? m - j0 : W;
        if (len == W) {
            for (int r = 0; r < rows; ++r) {
                double acc[W] = {0.0};
                for (int i = 0; i < k; ++i)
                    for (int j = 0; j < W; ++j) acc[j] += w[r * k + i] * x[i * m + j0 + j];
                for (int j = 0; j < W; ++j) out[static_cast<long>(r) * m + j0 + j] = acc[j];
            }
        } else {
            for (int r = 0; r < rows; ++r)
                for (int j = 0; j < len; ++j) {
                    double acc = 0.0;
                    for (int i = 0; i < k; ++i) acc += w[r * k + i] * x[i * m + j0 + j];
                    out[static_cast<long>(r) * m + j0 + j] = acc;
                }
        }
    }
}

THERMID_CLONES static int lu_factor(double* a, int* piv, double* inv, int n) {
    for (int k = 0; k < n; ++k) {
        int p = k;
        double best = std::fabs(a[k * n + k]), scale = best;
        for (int i = k + 1; i < n; ++i) {
            const double v = std::fabs(a[i * n + k]);
            scale = v > scale ? v : scale;
            // Keep the diagonal unless another is clearly larger: less fill, same safety (threshold pivoting).
            if (v > 10.0 * std::fabs(a[k * n + k]) && v > best) { best = v; p = i; }
        }
        if (!(scale > 0.0) || !std::isfinite(scale)) return k;
        piv[k] = p;
        if (p != k)
            for (int j = 0; j < n; ++j) std::swap(a[k * n + j], a[p * n + j]);
        const double r = inv[k] = 1.0 / a[k * n + k];
        if (!std::isfinite(r)) return k;
        for (int i = k + 1; i < n; ++i) {
            double l = a[i * n + k];
            if (l == 0.0) continue;
            l *= r;
            a[i * n + k] = l;
            for (int j = k + 1; j < n; ++j) a[i * n + j] -= l * a[k * n + j];
        }
    }
    return -1;
}

int Lu::factor() { return lu_factor(a_.data(), piv_.data(), inv_.data(), n_); }

void Lu::solve(double* b) const {
    const double* a = a_.data();
    for (int k = 0; k < n_; ++k)
        if (piv_[k] != k) std::swap(b[k], b[piv_[k]]);
    for (int i = 1; i < n_; ++i) {
        double s = b[i];
        for (int j = 0; j < i; ++j) s -= a[i * n_ + j] * b[j];
        b[i] = s;
    }
    for (int i = n_ - 1; i >= 0; --i) {
        double s = b[i];
        for (int j = i + 1; j < n_; ++j) s -= a[i * n_ + j] * b[j];
        b[i] = s * inv_[i];
    }
}

THERMID_CLONES static void lu_solve_many(const double* a, const double* inv, double* b, int n, int m) {
    for (int i = 1; i < n; ++i) {
        double* __restrict bi = b + static_cast<size_t>(i) * m;
        for (int j = 0; j < i; ++j) {
            const double l = a[i * n + j];
            if (l == 0.0) continue;
            const double* __restrict bj = b + static_cast<size_t>(j) * m;
            for (int k = 0; k < m; ++k) bi[k] -= l * bj[k];
        }
    }
    for (int i = n - 1; i >= 0; --i) {
        double* __restrict bi = b + static_cast<size_t>(i) * m;
        for (int j = i + 1; j < n; ++j) {
            const double u = a[i * n + j];
            if (u == 0.0) continue;
            const double* __restrict bj = b + static_cast<size_t>(j) * m;
            for (int k = 0; k < m; ++k) bi[k] -= u * bj[k];
        }
        const double r = inv[i];
        for (int k = 0; k < m; ++k) bi[k] *= r;
    }
}

void Lu::solve_many(double* b, int m) const {
    for (int k = 0; k < n_; ++k)
        if (piv_[k] != k)
            for (int j = 0; j < m; ++j) std::swap(b[static_cast<size_t>(k) * m + j], b[static_cast<size_t>(piv_[k]) * m + j]);
    lu_solve_many(a_.data(), inv_.data(), b, n_, m);
}

}  // namespace thermid
