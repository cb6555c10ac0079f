#include "algebra/linear.hpp"

#include "algebra/four.hpp"

#include <utility>

namespace thermid {

THERMID_CLONES void combine(double* THERMID_RESTRICT out, const double* const* rows, const double* w, int k, int m) {
    int i = 0;
    for (; i + 16 <= m; i += 16) {
        Four a = {}, b = {}, c = {}, d = {};
        for (int r = 0; r < k; ++r) {
            const Four* x = reinterpret_cast<const Four*>(rows[r] + i);
            a += w[r] * x[0];
            b += w[r] * x[1];
            c += w[r] * x[2];
            d += w[r] * x[3];
        }
        std::memcpy(out + i, &a, sizeof a);
        std::memcpy(out + i + 4, &b, sizeof b);
        std::memcpy(out + i + 8, &c, sizeof c);
        std::memcpy(out + i + 12, &d, sizeof d);
    }
    for (; i + 4 <= m; i += 4) {
        Four a = {};
        for (int r = 0; r < k; ++r) a += w[r] * *reinterpret_cast<const Four*>(rows[r] + i);
        std::memcpy(out + i, &a, sizeof a);
    }
    for (; i < m; ++i) {
        double sum = 0.0;
        for (int r = 0; r < k; ++r) sum += w[r] * rows[r][i];
        out[i] = sum;
    }
}

THERMID_CLONES void scale_rows(double* THERMID_RESTRICT b, const double* THERMID_RESTRICT a, int n, int m) {
    for (int i = 0; i < n; ++i, b += m) {
        const double s = a[i];
        int q = 0;
        for (; q + 20 <= m; q += 20) {
            Four* y = reinterpret_cast<Four*>(b + q);
            for (int v = 0; v < 5; ++v) y[v] = s * y[v];
        }
        for (; q + 4 <= m; q += 4) *reinterpret_cast<Four*>(b + q) = s * *reinterpret_cast<Four*>(b + q);
        for (; q < m; ++q) b[q] *= s;
    }
}

THERMID_CLONES void add(double* THERMID_RESTRICT y, double a, const double* THERMID_RESTRICT x, int m) {
    for (int i = 0; i < m; ++i) y[i] += a * x[i];
}

THERMID_CLONES void largest(double* THERMID_RESTRICT to, const double* THERMID_RESTRICT b, const char* counts, int n, int m) {
    for (int i = 0; i < n; ++i, b += m) {
        if (!counts[i]) continue;
        for (int q = 0; q < m; ++q) {
            const double x = std::fabs(b[q]);
            to[q] = x > to[q] ? x : to[q];
        }
    }
}

THERMID_CLONES void difference(double* THERMID_RESTRICT y, const double* THERMID_RESTRICT a, const double* THERMID_RESTRICT x,
                               const double* THERMID_RESTRICT b, const double* THERMID_RESTRICT z, int n, int m) {
    for (int i = 0; i < n; ++i, y += m, x += m, z += m) {
        const double s = a[i], t = b[i];
        int q = 0;
        for (; q + 20 <= m; q += 20) {
            Four* to = reinterpret_cast<Four*>(y + q);
            const Four *from = reinterpret_cast<const Four*>(x + q), *less = reinterpret_cast<const Four*>(z + q);
            for (int v = 0; v < 5; ++v) to[v] = s * from[v] - t * less[v];
        }
        for (; q < m; ++q) y[q] = s * x[q] - t * z[q];
    }
}

// Two rows of twelve at once: six sums in registers, and every vector of x that is loaded serves both.
THERMID_CLONES void blend(double* THERMID_RESTRICT out, const double* THERMID_RESTRICT w, int rows, const double* THERMID_RESTRICT x, int k, int m) {
    const int stride = padded(m);
    for (int r = 0; r < rows; r += 2, out += 2 * m, w += 2 * k) {
        const bool both = r + 1 < rows;
        const double* THERMID_RESTRICT v = both ? w + k : w;
        int j = 0;
        for (; j + 12 <= m; j += 12) {
            const double* from = x + j;
            Four a = {}, b = {}, c = {}, d = {}, e = {}, f = {};
            for (int i = 0; i < k; ++i, from += stride) {
                const Four* y = reinterpret_cast<const Four*>(from);
                const Four y0 = y[0], y1 = y[1], y2 = y[2];
                a += w[i] * y0;
                b += w[i] * y1;
                c += w[i] * y2;
                d += v[i] * y0;
                e += v[i] * y1;
                f += v[i] * y2;
            }
            if (both) {
                std::memcpy(out + m + j, &d, sizeof d);
                std::memcpy(out + m + j + 4, &e, sizeof e);
                std::memcpy(out + m + j + 8, &f, sizeof f);
            }
            std::memcpy(out + j, &a, sizeof a);
            std::memcpy(out + j + 4, &b, sizeof b);
            std::memcpy(out + j + 8, &c, sizeof c);
        }
        for (; j < m; j += 4) {
            const double* from = x + j;
            Four a = {}, d = {};
            for (int i = 0; i < k; ++i, from += stride) {
                const Four y = *reinterpret_cast<const Four*>(from);
                a += w[i] * y;
                d += v[i] * y;
            }
            const size_t size = sizeof(double) * (m - j < 4 ? m - j : 4);
            if (both) std::memcpy(out + m + j, &d, size);
            std::memcpy(out + j, &a, size);
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

void Lu::resize(int n) {
    n_ = n;
    const size_t m = n, half = m * (m > 0 ? m - 1 : 0) / 2;
    a_.assign(m * m, 0.0);
    inv_.assign(m, 0.0);
    for (auto* v : {&piv_, &low_end_, &up_end_}) v->assign(m, 0);
    for (auto* v : {&low_, &up_}) v->assign(half, 0.0);
    for (auto* v : {&low_at_, &up_at_}) v->assign(half, 0);
}

int Lu::factor() {
    const int bad = lu_factor(a_.data(), piv_.data(), inv_.data(), n_);
    if (bad >= 0) return bad;
    int l = 0, u = 0;
    swapped_ = false;
    for (int i = 0; i < n_; ++i) {
        const double *row = a_.data() + static_cast<size_t>(i) * n_;
        for (int j = 0; j < i; ++j)
            if (row[j] != 0.0) { low_[l] = row[j]; low_at_[l++] = j; }
        low_end_[i] = l;
        swapped_ = swapped_ || piv_[i] != i;
    }
    for (int i = n_ - 1; i >= 0; --i) {
        const double *row = a_.data() + static_cast<size_t>(i) * n_;
        for (int j = i + 1; j < n_; ++j)
            if (row[j] != 0.0) { up_[u] = row[j]; up_at_[u++] = j; }
        up_end_[i] = u;
    }
    return -1;
}

void Lu::solve(double* b) const {
    if (swapped_)
        for (int k = 0; k < n_; ++k)
            if (piv_[k] != k) std::swap(b[k], b[piv_[k]]);
    int k = 0;
    for (int i = 0; i < n_; ++i) {
        double s = b[i];
        for (const int end = low_end_[i]; k < end; ++k) s -= low_[k] * b[low_at_[k]];
        b[i] = s;
    }
    k = 0;
    for (int i = n_ - 1; i >= 0; --i) {
        double s = b[i];
        for (const int end = up_end_[i]; k < end; ++k) s -= up_[k] * b[up_at_[k]];
        b[i] = s * inv_[i];
    }
}

namespace {
struct Factors { const double *low, *up, *inv; const int *low_at, *low_end, *up_at, *up_end; };
}

THERMID_CLONES static void substitute(const Factors f, double* b, int n, int m) {
    int e = 0;
    for (int i = 0; i < n; ++i) {
        double* THERMID_RESTRICT bi = b + static_cast<size_t>(i) * m;
        for (const int end = f.low_end[i]; e < end; ++e) {
            const double l = f.low[e];
            const double* THERMID_RESTRICT bj = b + static_cast<size_t>(f.low_at[e]) * m;
            for (int k = 0; k < m; ++k) bi[k] -= l * bj[k];
        }
    }
    e = 0;
    for (int i = n - 1; i >= 0; --i) {
        double* THERMID_RESTRICT bi = b + static_cast<size_t>(i) * m;
        for (const int end = f.up_end[i]; e < end; ++e) {
            const double u = f.up[e];
            const double* THERMID_RESTRICT bj = b + static_cast<size_t>(f.up_at[e]) * m;
            for (int k = 0; k < m; ++k) bi[k] -= u * bj[k];
        }
        const double r = f.inv[i];
        for (int k = 0; k < m; ++k) bi[k] *= r;
    }
}

void Lu::solve_many(double* b, int m) const {
    if (swapped_)
        for (int k = 0; k < n_; ++k)
            if (piv_[k] != k)
                for (int j = 0; j < m; ++j) std::swap(b[static_cast<size_t>(k) * m + j], b[static_cast<size_t>(piv_[k]) * m + j]);
    substitute({low_.data(), up_.data(), inv_.data(), low_at_.data(), low_end_.data(), up_at_.data(), up_end_.data()}, b, n_, m);
}

}  // namespace thermid
