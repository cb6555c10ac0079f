// Householder reflections of many rows into a triangle.
#include <algorithm>
#include <cmath>

#include "algebra/four.hpp"
#include "leastsquares/leastsquares.hpp"
#include "algebra/linear.hpp"

namespace thermid {

namespace {
constexpr int WIDE = 4;             // numbers side by side
constexpr double NOTHING = 1e-280;  // square of a column that is zero
}  // namespace

// One pass over the rows: a_j -= a_pivot w_j finishes the reflection before, product_j = sum a_next a_j starts the one to come. Before the
// first there is no pivot, and w is zero. Columns left of the pivot's pack are done with.
THERMID_CLONES static void sweep(double* a, int rows, int stride, int pivot, int next, const double* w, double* product) {
    const int first = pivot / WIDE, last = stride / WIDE;
    const Four* of = reinterpret_cast<const Four*>(w);
    Four* sum = reinterpret_cast<Four*>(product);
    int i = 0;
    for (; i + 4 <= rows; i += 4, a += 4 * static_cast<size_t>(stride)) {
        double *a0 = a, *a1 = a + stride, *a2 = a1 + stride, *a3 = a2 + stride;
        const double p0 = a0[pivot], p1 = a1[pivot], p2 = a2[pivot], p3 = a3[pivot], wn = w[next];
        const double n0 = a0[next] - p0 * wn, n1 = a1[next] - p1 * wn, n2 = a2[next] - p2 * wn, n3 = a3[next] - p3 * wn;
        Four *b0 = reinterpret_cast<Four*>(a0), *b1 = reinterpret_cast<Four*>(a1), *b2 = reinterpret_cast<Four*>(a2), *b3 = reinterpret_cast<Four*>(a3);
        for (int j = first; j < last; ++j) {
            const Four v = of[j], x0 = b0[j] - p0 * v, x1 = b1[j] - p1 * v, x2 = b2[j] - p2 * v, x3 = b3[j] - p3 * v;
            b0[j] = x0;
            b1[j] = x1;
            b2[j] = x2;
            b3[j] = x3;
            sum[j] = sum[j] + ((n0 * x0 + n1 * x1) + (n2 * x2 + n3 * x3));
        }
    }
    for (; i < rows; ++i, a += stride) {
        const double p = a[pivot], n = a[next] - p * w[next];
        Four* b = reinterpret_cast<Four*>(a);
        for (int j = first; j < last; ++j) {
            b[j] = b[j] - p * of[j];
            sum[j] = sum[j] + n * b[j];
        }
    }
}

void Triangle::reset(int columns, int pivots) {
    stride_ = padded(columns);
    pivots_ = pivots;
    r_.assign(static_cast<size_t>(pivots) * stride_, 0.0);
    weight_.assign(stride_, 0.0);
    product_.assign(stride_, 0.0);
}

// Householder reflections of the triangle with the rows below it (Golub and Van Loan, Matrix Computations, 4th ed., section 5.2); column
// by column, v = (r_k - beta, a_k), H = I - 2 v v' / v'v.
void Triangle::absorb(double* rows, int count) {
    if (count == 0 || pivots_ == 0) return;
    std::fill(weight_.begin(), weight_.end(), 0.0);
    for (int k = 0; k < pivots_; ++k) {
        std::fill(product_.begin(), product_.end(), 0.0);
        sweep(rows, count, stride_, std::max(k - 1, 0), k, weight_.data(), product_.data());
        double* r = row(k);
        const double below = product_[k];
        std::fill(weight_.begin(), weight_.end(), 0.0);
        if (!(below > NOTHING)) continue;
        const double norm = std::sqrt(r[k] * r[k] + below), beta = r[k] > 0.0 ? -norm : norm, v = r[k] - beta, scale = -1.0 / (beta * v);
        for (int j = k + 1; j < stride_; ++j) {
            weight_[j] = scale * (v * r[j] + product_[j]);
            r[j] -= v * weight_[j];
        }
        r[k] = beta;
    }
}

}  // namespace thermid
