// Many rows of outputs at once: weights, which depend on time alone, times terms, which depend on the node alone.
#include <algorithm>
#include <cmath>

#include "four.hpp"
#include "integrator.hpp"

#if defined(__GNUC__)
#define THERMID_INLINE inline __attribute__((always_inline))
#else
#define THERMID_INLINE inline
#endif

namespace thermid {

namespace {

constexpr int CHUNK = 64;  // outputs at a time; weights are stored (terms, CHUNK)

// R rows and V vectors of four columns of out (rows, m) = w' (rows, k) x (k, padded(m)).
template <int R, int V>
THERMID_INLINE void tile(double* out, const double* w, const double* x, int k, int m, int columns) {
    const int stride = padded(m);
    Four sum[R][V] = {};
    for (int i = 0; i < k; ++i, w += CHUNK, x += stride) {
        const Four* from = reinterpret_cast<const Four*>(x);
        for (int r = 0; r < R; ++r)
            for (int v = 0; v < V; ++v) sum[r][v] += w[r] * from[v];
    }
    for (int r = 0; r < R; ++r) std::memcpy(out + static_cast<size_t>(r) * m, sum[r], sizeof(double) * columns);
}

template <int V>
THERMID_INLINE void columns(double* out, const double* w, int rows, const double* x, int k, int m, int count) {
    int r = 0;
    for (; r + 4 <= rows; r += 4) tile<4, V>(out + static_cast<size_t>(r) * m, w + r, x, k, m, count);
    for (; r < rows; ++r) tile<1, V>(out + static_cast<size_t>(r) * m, w + r, x, k, m, count);
}

THERMID_CLONES void weighted(double* out, const double* w, int rows, const double* x, int k, int m) {
    int j = 0;
    for (; j + 12 <= m; j += 12) columns<3>(out + j, w, rows, x + j, k, m, 12);
    for (; j + 4 <= m; j += 4) columns<1>(out + j, w, rows, x + j, k, m, 4);
    if (j < m) columns<1>(out + j, w, rows, x + j, k, m, m - j);
}

THERMID_CLONES void powers(double* THERMID_RESTRICT w, const double* THERMID_RESTRICT s, double h, int rows) {
    for (int r = 0; r < rows; ++r) {
        const double x = s[r] / h, x2 = x * x;
        w[r] = 1.0;
        w[CHUNK + r] = x;
        w[2 * CHUNK + r] = x2;
        w[3 * CHUNK + r] = x2 * x;
        w[4 * CHUNK + r] = x2 * x2;
        w[5 * CHUNK + r] = x2 * x2 * x;
    }
}

// Weights of b, db, c and aab, from the integrals of the input since the step's start.
THERMID_CLONES void left_over(double* THERMID_RESTRICT w, const double* THERMID_RESTRICT s, const double* THERMID_RESTRICT sums,
                              const StepInput in, int rows) {
    const double p0 = in.p0, p1 = in.p1, p2 = in.p2;
    for (int r = 0; r < rows; ++r) {
        const double x = s[r], x2 = x * x;
        const double v = sums[r] - x * (p0 + x * (p1 * (1.0 / 2.0) + x * (p2 * (1.0 / 3.0))));
        w[r] = v;
        w[CHUNK + r] = x * v;
        w[2 * CHUNK + r] = sums[CHUNK + r] - x2 * (p0 * (1.0 / 2.0) + x * (p1 * (1.0 / 6.0) + x * (p2 * (1.0 / 12.0))));
        w[3 * CHUNK + r] = sums[2 * CHUNK + r] - x2 * x * (p0 * (1.0 / 6.0) + x * (p1 * (1.0 / 24.0) + x * (p2 * (1.0 / 60.0))));
    }
}

}  // namespace

// Outputs of nodes with a delay.
void Integrator::write_block(const double* times, long first, long last, const int* obs, int nobs) {
    if (first == last) return;
    const size_t stride = padded(nobs);
    int terms = STAGES;
    for (const Noise& z : noise_) terms += z.active ? 4 : 0;
    block_.resize(terms * (stride + CHUNK));
    double* weights = block_.data() + terms * stride;
    auto fill = [&](int row, const double* v) {
        for (int j = 0; j < nobs; ++j) block_[row * stride + j] = v[obs[j]];
    };
    for (int m = 0; m < STAGES; ++m) fill(m, poly_.data() + m * static_cast<size_t>(n_));
    int at = STAGES;
    for (const Noise& z : noise_)
        if (z.active)
            for (const auto* v : {&z.b, &z.db, &z.c, &z.aab}) fill(at++, v->data());
    double s[CHUNK], sums[3 * CHUNK];
    for (long k = first; k < last; k += CHUNK) {
        const int rows = static_cast<int>(std::min<long>(CHUNK, last - k));
        for (int r = 0; r < rows; ++r) s[r] = times[k + r] == end_ ? h_ : times[k + r] - t_;
        powers(weights, s, h_, rows);
        if (s[0] < at_) move_cursors(s[0]);
        double* w = weights + STAGES * CHUNK;
        for (int i = 0; i < nk_; ++i) {
            if (!noise_[i].active) continue;
            cursor_[i].move(times + k, rows, sums, CHUNK);
            left_over(w, s, sums, in_[i], rows);
            w += 4 * CHUNK;
        }
        at_ = s[rows - 1];
        weighted(r_->traces + static_cast<size_t>(k) * nobs, weights, rows, block_.data(), terms, nobs);
    }
    move_cursors(at_);  // what stands at the last row is at hand for those who go on from there
}

}  // namespace thermid
