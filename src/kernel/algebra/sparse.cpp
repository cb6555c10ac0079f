#include "algebra/sparse.hpp"

#include "algebra/four.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <tuple>
#include <utility>

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

namespace {

using Neighbours = std::vector<std::vector<int>>;

// The graph of the symmetrised pattern, ascending, without the diagonal.
Neighbours graph_of(const Pattern& p) {
    Neighbours graph(p.n);
    for (int i = 0; i < p.n; ++i)
        for (int k = p.begin[i]; k < p.begin[i + 1]; ++k)
            if (p.col[k] != i) {
                graph[i].push_back(p.col[k]);
                graph[p.col[k]].push_back(i);
            }
    for (std::vector<int>& each : graph) {
        std::sort(each.begin(), each.end());
        each.erase(std::unique(each.begin(), each.end()), each.end());
    }
    return graph;
}

// Whether a matrix of n nodes with so many entries beside the diagonal, counted on one side, does better as a dense one.
bool crowded(size_t entries, int n) { return n > 8 && entries > static_cast<size_t>(n) * n / 6; }

}  // namespace

void Elimination::build(const Pattern& p) {
    const int n = p.n;
    rank.assign(n, -1);
    order.clear();
    // Node by node; ties go to the one that waits for the fewest before it, then to the first: a chain is eliminated from both of its ends.
    Neighbours graph = graph_of(p), later(n), before(n);
    std::vector<int> waits(n, 0);
    std::set<std::tuple<size_t, int, int>> queue;
    size_t entries = 0;
    for (int i = 0; i < n; ++i) {
        queue.emplace(graph[i].size(), 0, i);
        entries += graph[i].size();
    }
    full = crowded(entries / 2, n);
    entries = 0;
    std::vector<int> met;
    for (int step = 0; step < n && !full; ++step) {
        const int best = std::get<2>(*queue.begin());
        queue.erase(queue.begin());
        rank[best] = step;
        order.push_back(best);
        later[best].swap(graph[best]);
        entries += later[best].size();
        for (int i : later[best]) {
            queue.erase({graph[i].size(), waits[i], i});
            met.clear();
            std::set_union(graph[i].begin(), graph[i].end(), later[best].begin(), later[best].end(), std::back_inserter(met));
            met.erase(std::remove_if(met.begin(), met.end(), [=](int k) { return k == i || k == best; }), met.end());
            graph[i].swap(met);
            waits[i] = std::max(waits[i], waits[best] + 1);
            queue.emplace(graph[i].size(), waits[i], i);
        }
        full = crowded(entries, n);
    }
    if (full) return;
    for (int i : order)
        for (int j : later[i]) before[j].push_back(i);  // ascending in rank
    low_begin.assign(1, 0);
    up_begin.assign(1, 0);
    for (int i : order) {
        low_col.insert(low_col.end(), before[i].begin(), before[i].end());
        up_col.insert(up_col.end(), later[i].begin(), later[i].end());
        low_begin.push_back(static_cast<int>(low_col.size()));
        up_begin.push_back(static_cast<int>(up_col.size()));
    }
}

double Elimination::products() const {
    double sum = 0.0;
    for (int c : low_col) sum += up_begin[rank[c] + 1] - up_begin[rank[c]];
    return sum;
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

// One half of the factors, row by row in the order in which it is solved; `by` is the way through its entries.
struct Half { const int *row, *begin, *col; const double* value; int n, by; };

constexpr int LONG = 64;  // nodes from which a row's products are summed in four parts, so that none waits for the one before

// x less a row's products, in the order of the entries.
template <int BY>
THERMID_INLINE double row_less(double x, const int* col, const double* value, int first, int last, const double* b) {
    for (int k = first; k != last; k += BY) x -= value[k] * b[col[k]];
    return x;
}

THERMID_INLINE double row_less_in_parts(double x, const int* col, const double* value, int first, int last, const double* b) {
    double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
    int k = first;
    for (; k + 4 <= last; k += 4) {
        s0 += value[k] * b[col[k]];
        s1 += value[k + 1] * b[col[k + 1]];
        s2 += value[k + 2] * b[col[k + 2]];
        s3 += value[k + 3] * b[col[k + 3]];
    }
    for (; k < last; ++k) s0 += value[k] * b[col[k]];
    return x - ((s0 + s1) + (s2 + s3));
}

// Rows of b (n, m) less x times other rows: columns first to first + 4 N, sums in registers.
template <int N>
THERMID_INLINE void columns_less(const Half& f, int r, double* b, int m, int first) {
    Four sum[N];
    Four* to = reinterpret_cast<Four*>(b + static_cast<size_t>(f.row[r]) * m + first);
    for (int q = 0; q < N; ++q) sum[q] = to[q];
    const int low = f.begin[r], high = f.begin[r + 1];
    for (int k = f.by > 0 ? low : high - 1; k >= low && k < high; k += f.by) {
        const Four* from = reinterpret_cast<const Four*>(b + static_cast<size_t>(f.col[k]) * m + first);
        const double a = -f.value[k];
        for (int q = 0; q < N; ++q) sum[q] += a * from[q];
    }
    for (int q = 0; q < N; ++q) to[q] = sum[q];
}

// The same for fewer than four columns.
template <int N>
THERMID_INLINE void few_less(const Half& f, int r, double* b, int m, int first) {
    double sum[N];
    double* to = b + static_cast<size_t>(f.row[r]) * m + first;
    for (int q = 0; q < N; ++q) sum[q] = to[q];
    const int low = f.begin[r], high = f.begin[r + 1];
    for (int k = f.by > 0 ? low : high - 1; k >= low && k < high; k += f.by) {
        const double *from = b + static_cast<size_t>(f.col[k]) * m + first, a = -f.value[k];
        for (int q = 0; q < N; ++q) sum[q] += a * from[q];
    }
    for (int q = 0; q < N; ++q) to[q] = sum[q];
}

}  // namespace

THERMID_CLONES static void lower(const Half f, double* b) {
    for (int r = 0; r < f.n; ++r)
        b[f.row[r]] = f.n < LONG ? row_less<1>(b[f.row[r]], f.col, f.value, f.begin[r], f.begin[r + 1], b)
                                 : row_less_in_parts(b[f.row[r]], f.col, f.value, f.begin[r], f.begin[r + 1], b);
}

THERMID_CLONES static void upper(const Half f, double* b) {
    for (int r = f.n - 1; r >= 0; --r)
        b[f.row[r]] = f.n < LONG ? row_less<-1>(b[f.row[r]], f.col, f.value, f.begin[r + 1] - 1, f.begin[r] - 1, b)
                                 : row_less_in_parts(b[f.row[r]], f.col, f.value, f.begin[r], f.begin[r + 1], b);
}

THERMID_CLONES static void substitute(const Half f, double* b, int m) {
    for (int x = 0; x < f.n; ++x) {
        const int r = f.by > 0 ? x : f.n - 1 - x;
        if (f.begin[r] == f.begin[r + 1]) continue;
        int q = 0;
        for (; q + 20 <= m; q += 20) columns_less<5>(f, r, b, m, q);
        if (q + 12 <= m) {
            columns_less<3>(f, r, b, m, q);
            q += 12;
        }
        if (q + 8 <= m) {
            columns_less<2>(f, r, b, m, q);
            q += 8;
        }
        if (q + 4 <= m) {
            columns_less<1>(f, r, b, m, q);
            q += 4;
        }
        if (m - q == 3) few_less<3>(f, r, b, m, q);
        else if (m - q == 2) few_less<2>(f, r, b, m, q);
        else if (m - q == 1) few_less<1>(f, r, b, m, q);
    }
}

void SparseLu::solve(double* b) const {
    if (dense_) return lu_.solve(b);
    const int n = p_->n;
    lower({e_->order.data(), e_->low_begin.data(), e_->low_col.data(), low_.data(), n, 1}, b);
    for (int i = 0; i < n; ++i) b[i] *= inv_[i];
    upper({e_->order.data(), e_->up_begin.data(), e_->up_col.data(), up_.data(), n, -1}, b);
}

void SparseLu::solve_many(double* b, int m) const {
    if (dense_) return lu_.solve_many(b, m);
    substitute({e_->order.data(), e_->low_begin.data(), e_->low_col.data(), low_.data(), p_->n, 1}, b, m);
    scale_rows(b, inv_.data(), p_->n, m);
    substitute({e_->order.data(), e_->up_begin.data(), e_->up_col.data(), up_.data(), p_->n, -1}, b, m);
}

}  // namespace thermid
