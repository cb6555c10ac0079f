// Many rows of outputs at once: weights, which depend on time alone, times terms, which depend on the node alone.
#include "algebra/traces.hpp"

#include <cstring>

#include "algebra/four.hpp"

namespace thermid {

namespace {

// R rows and V vectors of four columns of out (rows, m) = w' (rows, k) x (k, padded(m)); of the last vector `part` columns.
template <int R, int V>
THERMID_INLINE void tile(double* out, const double* w, const double* x, int k, int m, int part = 4) {
    const int stride = (m + 3) / 4 * 4;
    Four sum[R][V];
    const Four* from = reinterpret_cast<const Four*>(x);
    for (int r = 0; r < R; ++r)
        for (int v = 0; v < V; ++v) sum[r][v] = from[v];  // 1 comes first
    for (int i = 1; i < k; ++i) {
        w += CHUNK;
        x += stride;
        from = reinterpret_cast<const Four*>(x);
        for (int r = 0; r < R; ++r)
            for (int v = 0; v < V; ++v) sum[r][v] += w[r] * from[v];
    }
    for (int r = 0; r < R; ++r) {
        double* to = out + static_cast<size_t>(r) * m;
        if (part < 4) {
            std::memcpy(to, sum[r], sizeof(double) * part);
            continue;
        }
        for (int v = 0; v < V; ++v) reinterpret_cast<Four*>(to)[v] = sum[r][v];
    }
}

// R rows, from the first column to the last, so that memory is filled in its own order.
template <int R>
THERMID_INLINE void line(double* out, const double* w, const double* x, int k, int m) {
    int j = 0;
    for (; j + 12 <= m; j += 12) tile<R, 3>(out + j, w, x + j, k, m);
    for (; j + 4 <= m; j += 4) tile<R, 1>(out + j, w, x + j, k, m);
    if (j < m) tile<R, 1>(out + j, w, x + j, k, m, m - j);
}

}  // namespace

THERMID_CLONES void weighted(double* out, const double* w, int rows, const double* x, int k, int m) {
    int r = 0;
    for (; r + 4 <= rows; r += 4) line<4>(out + static_cast<size_t>(r) * m, w + r, x, k, m);
    for (; r < rows; ++r) line<1>(out + static_cast<size_t>(r) * m, w + r, x, k, m);
}

THERMID_CLONES void powers(double* THERMID_RESTRICT w, double* THERMID_RESTRICT s, const double* THERMID_RESTRICT times, double t, double end, double h,
                           int rows) {
    for (int r = 0; r < rows; ++r) {
        s[r] = times[r] == end ? h : times[r] - t;
        const double x = s[r] / h, x2 = x * x;
        w[r] = 1.0;
        w[CHUNK + r] = x;
        w[2 * CHUNK + r] = x2;
        w[3 * CHUNK + r] = x2 * x;
        w[4 * CHUNK + r] = x2 * x2;
        w[5 * CHUNK + r] = x2 * x2 * x;
    }
}

THERMID_CLONES void left_over(double* THERMID_RESTRICT w, double* THERMID_RESTRICT more, const double* THERMID_RESTRICT s,
                              const double* THERMID_RESTRICT sums, const StepInput in, int rows) {
    const double p0 = in.p0, p1 = in.p1, p2 = in.p2;
    for (int r = 0; r < rows; ++r) {
        const double x = s[r], x2 = x * x;
        const double v = sums[r] - x * (p0 + x * (p1 * (1.0 / 2.0) + x * (p2 * (1.0 / 3.0))));
        w[r] = v;
        w[CHUNK + r] = sums[CHUNK + r] - x2 * (p0 * (1.0 / 2.0) + x * (p1 * (1.0 / 6.0) + x * (p2 * (1.0 / 12.0))));
        more[r] = x * v;
        more[CHUNK + r] = sums[2 * CHUNK + r] - x2 * x * (p0 * (1.0 / 6.0) + x * (p1 * (1.0 / 24.0) + x * (p2 * (1.0 / 60.0))));
    }
}

}  // namespace thermid
