// Heats of all rows and their slopes at given temperatures: the innermost work of every run.
#include <algorithm>
#include <cmath>

#include "network/followers.hpp"

namespace thermid {

namespace {

// Where conductors stand: ends, coefficients, tables, and what is found for each.
struct Rows {
    const int *a, *b, *c0, *c1, *table, *place;
    const double *t, *c;
    const Table* tables;
    int* piece;
    double *q, *phi, *qa, *qb;
};

// All rows of one law; `exponent` stands for their second coefficient where it is the same number in all.
template <class Law, class... C>
THERMID_INLINE void each(const Rows& x, int first, int last, C... exponent) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0, *THERMID_RESTRICT c1 = x.c1;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT c = x.c;
    double *THERMID_RESTRICT q = x.q, *THERMID_RESTRICT phi = x.phi, *THERMID_RESTRICT qa = x.qa, *THERMID_RESTRICT qb = x.qb;
    for (int r = first; r < last; ++r) {
        const KeptTables tables{x.tables + x.table[r], x.piece + x.place[r]};
        Conduct<double> y;
        if constexpr (sizeof...(C) > 0) y = Law::heat(t[a[r]], t[b[r]], c[c0[r]], exponent..., tables);
        else y = Law::heat(t[a[r]], t[b[r]], c[c0[r]], c[c1[r]], tables);
        q[r] = y.q;
        phi[r] = y.phi;
        qa[r] = y.qa;
        qb[r] = y.qb;
    }
}

#define THERMID_ROWS(KIND, LAW, ...) \
    THERMID_CLONES void rows_of_##KIND(const Rows& x, int first, int last) { each<LAW>(x, first, last); }
THERMID_CONDUCTORS(THERMID_ROWS)
#undef THERMID_ROWS
THERMID_CLONES void quarter_rows(const Rows& x, int first, int last) { each<Power>(x, first, last, Quarter{}); }

#define THERMID_ROWS(KIND, ...) rows_of_##KIND,
constexpr void (*ROWS_OF[])(const Rows&, int, int) = {THERMID_CONDUCTORS(THERMID_ROWS)};
#undef THERMID_ROWS

// Behind m numbers, what each of them is less than zero.
THERMID_CLONES void negatives(double* x, int m) {
    const double* THERMID_RESTRICT from = x;
    double* THERMID_RESTRICT to = x + m;
    for (int i = 0; i < m; ++i) to[i] = -from[i];
}

THERMID_CLONES void shifted_rows(const int* THERMID_RESTRICT a, const int* THERMID_RESTRICT b, const double* THERMID_RESTRICT q,
                                 const double* THERMID_RESTRICT qa, const double* THERMID_RESTRICT qb, const double* THERMID_RESTRICT delta,
                                 double w, double* THERMID_RESTRICT out, int m) {
    for (int r = 0; r < m; ++r) out[r] += w * (q[r] - qa[r] * delta[a[r]] - qb[r] * delta[b[r]]);
}

}  // namespace

void Evaluation::shift(double w, const double* delta, double* conductors, double* loads) const {
    shifted_rows(p->con.a.data(), p->con.b.data(), q.data(), qa, qb, delta, w, conductors, p->con.size());
    const int m = p->load.size();
    const int* felt = p->load.felt.data();
    for (int r = 0; r < m; ++r) loads[r] += w * (power[r] - slope[r] * delta[felt[r]] - slope[m + r] * delta[felt[m + r]]);
    if (!p->followers.empty()) follow_rows(-w, delta, conductors, loads);
}

void Evaluation::lean(double w, const double* dir, double* conductors, double* loads) const {
    for (int r = 0; r < p->con.size(); ++r) conductors[r] += w * (qa[r] * dir[p->con.a[r]] + qb[r] * dir[p->con.b[r]]);
    const int m = p->load.size();
    const int* felt = p->load.felt.data();
    for (int r = 0; r < m; ++r) loads[r] += w * (slope[r] * dir[felt[r]] + slope[m + r] * dir[felt[m + r]]);
    if (!p->followers.empty()) follow_rows(w, dir, conductors, loads);
}

void Evaluation::rows() {
    if (!p->followers.empty()) follow();
    const Conductors& c = p->con;
    const int* first = p->kind_begin;
    const Rows x{c.a.data(), c.b.data(), c.c0.data(), c.c1.data(), c.table.data(), c.place.data(), t.data(), ceff.data(), p->tables.data(),
                 piece.data(), q.data(), phi.data(), qa, qb};
    for (int k = 0; k < CONDUCTOR_KINDS; ++k)
        if (first[k] < first[k + 1]) (k == POWER && quarter ? quarter_rows : ROWS_OF[k])(x, first[k], first[k + 1]);
    const int *begin = p->meet_begin.data(), *row = p->meet_row.data();
    const double* heat = q.data();
    negatives(q.data(), c.size());
    for (int i = 0, k = 0; i < p->n; ++i) {
        double s = 0.0;
        for (const int end = begin[i + 1]; k < end; ++k) s += heat[row[k]];
        f[i] = s;
    }
    const Loads& ld = p->load;
    for (int r = 0; r < ld.size(); ++r) {
        if (ld.kind[r] == SIGNAL && ld.control[r] < 0) f[ld.node[r]] += power[r] = ceff[ld.c[0][r]];
        else f[ld.node[r]] += put_load(r);
    }
    if (!p->followers.empty()) find_pull();
}

void Problem::sum_slopes(double* qab, const double* loads, double* v) const {
    negatives(qab, 2 * con.size());
    const int* first = slope_first.data();
    for (int i = 0, m = pattern.size(); i < m; ++i) v[i] = qab[first[i]];
    const int *k = slope_further.data(), *end = k + slope_further.size();
    for (; k != end; k += 2) v[k[0]] += qab[k[1]];
    for (int r = 0, m = 2 * load.size(); r < m; ++r)
        if (load_place[r] >= 0) v[load_place[r]] += loads[r];
}

void Evaluation::slopes(double* v) {
    p->sum_slopes(qab.data(), slope.data(), v);
    if (!p->followers.empty()) follow_slopes(v);
}

void Evaluation::jacobian(double* j) const {
    const int n = p->n;
    std::fill(j, j + static_cast<size_t>(n) * n, 0.0);
    const Conductors& c = p->con;
    for (int r = 0; r < c.size(); ++r) {
        const size_t a = c.a[r], b = c.b[r];
        if (c.a[r] < n && !is(c.kind[r], ONE_WAY)) {
            j[a * n + a] -= qa[r];
            if (c.b[r] < n) j[a * n + b] -= qb[r];
        }
        if (c.b[r] < n) {
            if (c.a[r] < n) j[b * n + a] += qa[r];
            j[b * n + b] += qb[r];
        }
    }
    const Loads& l = p->load;
    for (int k = 0; k < 2 * l.size(); ++k)
        if (slope[k] != 0.0 && l.felt[k] < n) j[static_cast<size_t>(l.node[k % l.size()]) * n + l.felt[k]] += slope[k];
    each_pull([&](size_t f, size_t, double by, const Probe& x) {
        for (size_t i = 0; i < pull[f].size(); ++i)
            for (int k = 0; k < 3; ++k)
                if (x.node[k] >= 0 && x.node[k] < n) j[static_cast<size_t>(p->followers[f].nodes[i]) * n + x.node[k]] += pull[f][i] * by * ceff[x.c[k]];
    });
}

}  // namespace thermid
