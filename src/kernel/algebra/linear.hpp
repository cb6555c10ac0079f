// Small dense linear algebra: LU with partial pivoting that skips zeros (thermal networks are sparse and the
// pattern repeats), and the long inner loops over parameters, compiled for several instruction sets where possible.
#pragma once
#include <cmath>
#include <cstring>
#include <vector>

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#if __GNUC__ >= 12
#define THERMID_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define THERMID_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
#else
#define THERMID_CLONES
#endif

#if defined(__GNUC__)
#define THERMID_INLINE inline __attribute__((always_inline))
#else
#define THERMID_INLINE inline
#endif

#if defined(_MSC_VER)
#define THERMID_RESTRICT __restrict
#else
#define THERMID_RESTRICT __restrict__
#endif

namespace thermid {

// out[i] = sum_k w[k] * rows[k][i], for i < m.
void combine(double* out, const double* const* rows, const double* w, int k, int m);
// out (rows, m) = w (rows, k) x (k, padded(m))
inline int padded(int m) { return (m + 3) / 4 * 4; }
void blend(double* out, const double* w, int rows, const double* x, int k, int m);
// Row i of b (n, m) times a[i]; row i of y = a[i] times that of x less b[i] times that of z.
void scale_rows(double* b, const double* a, int n, int m);
// to[q] = the largest |b(i, q)| over the rows i that count, or what stands there.
void largest(double* to, const double* b, const char* counts, int n, int m);
void difference(double* y, const double* a, const double* x, const double* b, const double* z, int n, int m);
// y[i] += a * x[i]
inline void axpy(double* y, double a, const double* x, int m) {
    for (int i = 0; i < m; ++i) y[i] += a * x[i];
}

void add(double* y, double a, const double* x, int m);  // the same for long rows

class Lu {
  public:
    void resize(int n);
    double* data() { return a_.data(); }
    // Returns -1, or the column at which no usable pivot was found.
    int factor();
    void solve(double* b) const;
    void solve_many(double* b, int m) const;  // b is (n, m), row-major

  private:
    int n_ = 0;
    std::vector<double> a_, inv_;
    std::vector<int> piv_;
    // The factors' entries off the diagonal, row by row: lower from the top, upper from the bottom.
    std::vector<double> low_, up_;
    std::vector<int> low_at_, up_at_, low_end_, up_end_;
    bool swapped_ = false;
};

}  // namespace thermid
