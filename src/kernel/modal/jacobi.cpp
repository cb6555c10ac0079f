// Eigenvalues of F^T F by one-sided Jacobi rotations, and the phi functions: what the modal solution stands on.
#include <algorithm>
#include <cmath>
#include <limits>

#include "modal/modal.hpp"

namespace thermid {

namespace {

constexpr double EPS = std::numeric_limits<double>::epsilon();

double dot(const double* x, const double* y, int n) {
    double s = 0.0;
    for (int i = 0; i < n; ++i) s += x[i] * y[i];
    return s;
}

void rotate(double* x, double* y, double c, double s, int n) {
    for (int i = 0; i < n; ++i) {
        const double a = x[i], b = y[i];
        x[i] = c * a - s * b;
        y[i] = s * a + c * b;
    }
}

// F (m, n) -> its triangular factor (n, n), by Householder reflections: stable column by column.
void triangle(std::vector<double>& f, int m, int n, std::vector<double>& x) {
    for (int j = 0; j < std::min(m, n); ++j) {
        double* v = f.data() + static_cast<size_t>(j) * m;
        const double norm = std::sqrt(dot(v + j, v + j, m - j));
        if (norm == 0.0) continue;
        const double alpha = v[j] > 0.0 ? -norm : norm, head = v[j] - alpha, scale = -1.0 / (alpha * head);
        v[j] = head;
        for (int k = j + 1; k < n; ++k) {
            double* y = f.data() + static_cast<size_t>(k) * m;
            const double t = scale * dot(v + j, y + j, m - j);
            for (int i = j; i < m; ++i) y[i] -= t * v[i];
        }
        v[j] = alpha;
    }
    x.assign(static_cast<size_t>(n) * n, 0.0);
    for (int j = 0; j < n; ++j) std::copy_n(f.data() + static_cast<size_t>(j) * m, std::min(j + 1, m), x.data() + static_cast<size_t>(j) * n);
}

}  // namespace

bool jacobi(std::vector<double>& f, int m, int n, std::vector<double>& values, std::vector<double>& vectors) {
    std::vector<double> x, floor(n);
    triangle(f, m, n, x);
    values.assign(n, 0.0);
    vectors.assign(static_cast<size_t>(n) * n, 0.0);
    auto column = [&](std::vector<double>& of, int j) { return of.data() + static_cast<size_t>(j) * n; };
    for (int j = 0; j < n; ++j) {
        vectors[static_cast<size_t>(j) * n + j] = 1.0;
        // Below this a column is what rounding left of it: an eigenvalue of zero.
        floor[j] = dot(column(x, j), column(x, j), n) * (4.0 * n * EPS) * (4.0 * n * EPS);
    }
    bool turned = true;
    for (int sweep = 0; turned; ++sweep) {
        if (sweep == 60) return false;
        turned = false;
        for (int j = 0; j < n; ++j) values[j] = dot(column(x, j), column(x, j), n);
        for (int p = 0; p < n; ++p) {
            for (int q = p + 1; q < n; ++q) {
                double &a = values[p], &b = values[q];
                if (!(a > floor[p] && b > floor[q])) continue;
                const double g = dot(column(x, p), column(x, q), n);
                if (!(std::fabs(g) > n * EPS * std::sqrt(a) * std::sqrt(b))) continue;
                turned = true;
                const double z = (b - a) / (2.0 * g), t = (z < 0.0 ? -1.0 : 1.0) / (std::fabs(z) + std::sqrt(1.0 + z * z));
                const double c = 1.0 / std::sqrt(1.0 + t * t), s = c * t;
                rotate(column(x, p), column(x, q), c, s, n);
                rotate(column(vectors, p), column(vectors, q), c, s, n);
                a = std::max(a - t * g, 0.0);
                b = std::max(b + t * g, 0.0);
                const double low = floor[p], other = floor[q];
                floor[p] = std::max(low, t * t * other);
                floor[q] = std::max(other, t * t * low);
            }
        }
    }
    for (int j = 0; j < n; ++j)
        if (values[j] <= floor[j]) values[j] = 0.0;
    return true;
}

Phi phi(double x) {
    if (x < 1.0) {
        constexpr double C[] = {1.0 / 6, -1.0 / 24, 1.0 / 120, -1.0 / 720, 1.0 / 5040, -1.0 / 40320, 1.0 / 362880, -1.0 / 3628800, 1.0 / 39916800,
                                -1.0 / 479001600, 1.0 / 6227020800.0, -1.0 / 87178291200.0, 1.0 / 1307674368000.0, -1.0 / 20922789888000.0,
                                1.0 / 355687428096000.0, -1.0 / 6402373705728000.0};
        double p3 = C[15];
        for (int k = 14; k >= 0; --k) p3 = p3 * x + C[k];
        const double p2 = 0.5 - x * p3, p1 = 1.0 - x * p2;
        return {1.0 - x * p1, p1, p2, p3};
    }
    const double e = std::exp(-x), p1 = (1.0 - e) / x, p2 = (1.0 - p1) / x;
    return {e, p1, p2, (0.5 - p2) / x};
}

}  // namespace thermid
