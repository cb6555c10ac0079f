#include "algebra/sparse.hpp"

#include "algebra/four.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace thermid {

void Pattern::build(int nodes, std::vector<std::vector<int>> rows) {
    n = nodes;
    begin.assign(1, 0);
    col.clear();
    diag.assign(n, 0);
    for (int i = 0; i < n; ++i) {
        std::vector<int>& r = rows[i];
        r.push_back(i);
        std::sort(r.begin(), r.end());
        r.erase(std::unique(r.begin(), r.end()), r.end());
        for (int j : r) {
            if (j == i) diag[i] = size();
            col.push_back(j);
        }
        begin.push_back(size());
    }
}

int Pattern::at(int i, int j) const {
    const auto first = col.begin() + begin[i], last = col.begin() + begin[i + 1], found = std::lower_bound(first, last, j);
    return found != last && *found == j ? static_cast<int>(found - col.begin()) : size();
}

void Pattern::times(const double* v, const double* x, double* y) const {
    for (int i = 0; i < n; ++i) {
        double s = 0.0;
        for (int k = begin[i]; k < begin[i + 1]; ++k) s += v[k] * x[col[k]];
        y[i] = s;
    }
}

// y += scale * (entries first to last of a row) x, with the sums in registers.
THERMID_CLONES static void rows_times(const int* col, const double* v, int first, int last, double scale, const double* x, double* y, int m) {
    int q = 0;
    for (; q + 20 <= m; q += 20) {
        Four a = {}, b = {}, c = {}, d = {}, e = {};
        for (int k = first; k < last; ++k) {
            const Four* from = reinterpret_cast<const Four*>(x + static_cast<size_t>(col[k]) * m + q);
            a += v[k] * from[0];
            b += v[k] * from[1];
            c += v[k] * from[2];
            d += v[k] * from[3];
            e += v[k] * from[4];
        }
        Four* to = reinterpret_cast<Four*>(y + q);
        to[0] += scale * a;
        to[1] += scale * b;
        to[2] += scale * c;
        to[3] += scale * d;
        to[4] += scale * e;
    }
    for (; q + 4 <= m; q += 4) {
        Four a = {};
        for (int k = first; k < last; ++k) a += v[k] * *reinterpret_cast<const Four*>(x + static_cast<size_t>(col[k]) * m + q);
        *reinterpret_cast<Four*>(y + q) += scale * a;
    }
    for (; q < m; ++q) {
        double sum = 0.0;
        for (int k = first; k < last; ++k) sum += v[k] * x[static_cast<size_t>(col[k]) * m + q];
        y[q] += scale * sum;
    }
}

template <int N>
THERMID_INLINE void rows_sum(const int* begin, const int* col, int n, const double* scale, const double* g, const double* v, const double* x,
                             const double* w, const double* z, double* y, int m) {
    for (int i = 0; i < n; ++i) {
        Four sum[N];
        for (int q = 0; q < N; ++q) sum[q] = reinterpret_cast<const Four*>(g + static_cast<size_t>(i) * m)[q];
        for (int k = begin[i]; k < begin[i + 1]; ++k) {
            const Four* from = reinterpret_cast<const Four*>(x + static_cast<size_t>(col[k]) * m);
            for (int q = 0; q < N; ++q) sum[q] += v[k] * from[q];
            if (!w) continue;
            from = reinterpret_cast<const Four*>(z + static_cast<size_t>(col[k]) * m);
            for (int q = 0; q < N; ++q) sum[q] += w[k] * from[q];
        }
        Four* to = reinterpret_cast<Four*>(y + static_cast<size_t>(i) * m);
        for (int q = 0; q < N; ++q) to[q] = scale[i] * sum[q];
    }
}

THERMID_CLONES static void all_rows_sum(const int* begin, const int* col, int n, const double* scale, const double* g, const double* v,
                                        const double* x, const double* w, const double* z, double* y, int m) {
    int q = 0;
    for (; q + 20 <= m; q += 20) rows_sum<5>(begin, col, n, scale, g + q, v, x + q, w, z + q, y + q, m);
    for (; q + 4 <= m; q += 4) rows_sum<1>(begin, col, n, scale, g + q, v, x + q, w, z + q, y + q, m);
    if (q == m) return;
    for (int i = 0; i < n; ++i)
        for (int p = q; p < m; ++p) {
            double sum = g[static_cast<size_t>(i) * m + p];
            for (int k = begin[i]; k < begin[i + 1]; ++k) {
                sum += v[k] * x[static_cast<size_t>(col[k]) * m + p];
                if (w) sum += w[k] * z[static_cast<size_t>(col[k]) * m + p];
            }
            y[static_cast<size_t>(i) * m + p] = scale[i] * sum;
        }
}

void Pattern::sum(const double* scale, const double* g, const double* v, const double* x, const double* w, const double* z, double* y,
                  int m) const {
    all_rows_sum(begin.data(), col.data(), n, scale, g, v, x, w, z, y, m);
}

void Pattern::times(const double* v, const double* x, double* y, int m) const {
    std::fill(y, y + static_cast<size_t>(n) * m, 0.0);
    for (int i = 0; i < n; ++i) row_times(v, i, 1.0, x, y + static_cast<size_t>(i) * m, m);
}

void Pattern::row_times(const double* v, int i, double scale, const double* x, double* y, int m) const {
    rows_times(col.data(), v, begin[i], begin[i + 1], scale, x, y, m);
}

void Elimination::build(const Pattern& p) {
    const int n = p.n;
    full = n > 1500;  // finding the order would cost more than it saves
    if (full) return;
    rank.assign(n, -1);
    order.clear();
    // The graph of the symmetrised pattern, eliminated node by node; ties go to the first.
    std::vector<std::set<int>> graph(n);
    for (int i = 0; i < n; ++i)
        for (int k = p.begin[i]; k < p.begin[i + 1]; ++k)
            if (p.col[k] != i) {
                graph[i].insert(p.col[k]);
                graph[p.col[k]].insert(i);
            }
    std::vector<std::vector<int>> later(n), before(n);
    size_t entries = 0;
    for (int step = 0; step < n && !full; ++step) {
        int best = -1;
        for (int i = 0; i < n; ++i)
            if (rank[i] < 0 && (best < 0 || graph[i].size() < graph[best].size())) best = i;
        rank[best] = step;
        order.push_back(best);
        later[best].assign(graph[best].begin(), graph[best].end());
        entries += later[best].size();
        for (int i : later[best]) {
            graph[i].erase(best);
            for (int j : later[best])
                if (j != i) graph[i].insert(j);
        }
        full = n > 8 && entries > static_cast<size_t>(n) * n / 6;
    }
    if (full) return;
    for (int i : order)
        for (int j : later[i]) before[j].push_back(i);  // ascending in rank
    low_begin.assign(1, 0);
    up_begin.assign(1, 0);
    for (int i : order) {
        low_col.insert(low_col.end(), before[i].begin(), before[i].end());
        up_col.insert(up_col.end(), later[i].begin(), later[i].end());
        low_row.resize(low_col.size(), i);
        up_row.resize(up_col.size(), i);
        low_begin.push_back(static_cast<int>(low_col.size()));
        up_begin.push_back(static_cast<int>(up_col.size()));
    }
}

void SparseLu::resize(const Pattern& p, const Elimination& e) {
    p_ = &p;
    e_ = &e;
    a_.assign(p.size() + 1, 0.0);
    inv_.assign(p.n, 0.0);
    work_.assign(p.n, 0.0);
    low_.assign(e.low_col.size(), 0.0);
    up_.assign(e.up_col.size(), 0.0);
}

// Row by row in the order chosen. False where a pivot is too small beside what it eliminates.
bool SparseLu::eliminate() {
    const Pattern& p = *p_;
    double* w = work_.data();
    const int *low_col = e_->low_col.data(), *up_col = e_->up_col.data(), *up_begin = e_->up_begin.data();
    for (int r = 0; r < p.n; ++r) {
        const int i = e_->order[r], l0 = e_->low_begin[r], l1 = e_->low_begin[r + 1], u0 = up_begin[r], u1 = up_begin[r + 1];
        for (int k = l0; k < l1; ++k) w[low_col[k]] = 0.0;
        for (int k = u0; k < u1; ++k) w[up_col[k]] = 0.0;
        for (int k = p.begin[i]; k < p.begin[i + 1]; ++k) w[p.col[k]] = a_[k];
        for (int k = l0; k < l1; ++k) {
            const int c = low_col[k];
            const double own = w[c], l = own * inv_[c];
            low_[k] = l;
            if (!(std::fabs(l) <= 10.0)) return false;
            for (int q = up_begin[e_->rank[c]], end = up_begin[e_->rank[c] + 1]; q < end; ++q) w[up_col[q]] -= own * up_[q];
        }
        inv_[i] = 1.0 / w[i];
        if (!std::isfinite(inv_[i]) || inv_[i] == 0.0) return false;
        for (int k = u0; k < u1; ++k) up_[k] = w[up_col[k]] * inv_[i];
    }
    return true;
}

int SparseLu::factor() {
    dense_ = e_->full || !eliminate();
    if (!dense_) return -1;
    const int n = p_->n;
    lu_.resize(n);
    double* a = lu_.data();
    for (int i = 0; i < n; ++i)
        for (int k = p_->begin[i]; k < p_->begin[i + 1]; ++k) a[static_cast<size_t>(i) * n + p_->col[k]] = a_[k];
    return lu_.factor();
}

namespace {
struct Halves { const int *low_row, *low_col, *up_row, *up_col; const double *low, *up, *inv; int n, lows, ups; };
}

THERMID_CLONES static void substitute(const Halves f, double* b) {
    for (int k = 0; k < f.lows; ++k) b[f.low_row[k]] -= f.low[k] * b[f.low_col[k]];
    for (int i = 0; i < f.n; ++i) b[i] *= f.inv[i];
    for (int k = f.ups - 1; k >= 0; --k) b[f.up_row[k]] -= f.up[k] * b[f.up_col[k]];
}

void SparseLu::solve(double* b) const {
    if (dense_) return lu_.solve(b);
    substitute({e_->low_row.data(), e_->low_col.data(), e_->up_row.data(), e_->up_col.data(), low_.data(), up_.data(), inv_.data(), p_->n,
                static_cast<int>(low_.size()), static_cast<int>(up_.size())},
               b);
}

// Rows of b (n, m): minus x times another row, for each entry, first to last or last to first.
THERMID_CLONES static void substitute(const double* x, const int* row, const int* col, int first, int last, int by, double* b, int m) {
    for (int k = first; k != last; k += by) {
        double* THERMID_RESTRICT to = b + static_cast<size_t>(row[k]) * m;
        const double* THERMID_RESTRICT from = b + static_cast<size_t>(col[k]) * m;
        const double a = -x[k];
        int q = 0;
        for (; q + 20 <= m; q += 20) {
            Four* y = reinterpret_cast<Four*>(to + q);
            const Four* z = reinterpret_cast<const Four*>(from + q);
            y[0] += a * z[0];
            y[1] += a * z[1];
            y[2] += a * z[2];
            y[3] += a * z[3];
            y[4] += a * z[4];
        }
        for (; q + 4 <= m; q += 4) *reinterpret_cast<Four*>(to + q) += a * *reinterpret_cast<const Four*>(from + q);
        for (; q < m; ++q) to[q] += a * from[q];
    }
}

void SparseLu::solve_many(double* b, int m) const {
    if (dense_) return lu_.solve_many(b, m);
    substitute(low_.data(), e_->low_row.data(), e_->low_col.data(), 0, static_cast<int>(low_.size()), 1, b, m);
    scale_rows(b, inv_.data(), p_->n, m);
    substitute(up_.data(), e_->up_row.data(), e_->up_col.data(), static_cast<int>(up_.size()) - 1, -1, -1, b, m);
}

}  // namespace thermid
