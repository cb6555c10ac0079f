// Heats of all rows and their slopes at given temperatures: the innermost work of every run.
#include <algorithm>
#include <cmath>

#include "problem.hpp"

namespace thermid {

namespace {

// Where conductors stand: ends, coefficients, and what is found for each.
struct Rows {
    const int *a, *b, *c0, *c1;
    const double *t, *c;
    double *q, *phi, *qa, *qb;
};

THERMID_CLONES void linear_rows(const Rows x, int first, int last) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT c = x.c;
    double *THERMID_RESTRICT q = x.q, *THERMID_RESTRICT phi = x.phi, *THERMID_RESTRICT qa = x.qa, *THERMID_RESTRICT qb = x.qb;
    for (int r = first; r < last; ++r) {
        const double d = t[a[r]] - t[b[r]], g = c[c0[r]];
        phi[r] = d;
        qa[r] = g;
        qb[r] = -g;
        q[r] = g * d;
    }
}

// Exponent 1/4: |d|^(1/4) = (d^2 + s)^(1/8), three square roots.
THERMID_CLONES void quarter_rows(const Rows x, int first, int last) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT c = x.c;
    double *THERMID_RESTRICT q = x.q, *THERMID_RESTRICT phi = x.phi, *THERMID_RESTRICT qa = x.qa, *THERMID_RESTRICT qb = x.qb;
    for (int r = first; r < last; ++r) {
        const double d = t[a[r]] - t[b[r]], g = c[c0[r]], e = d * d + SMOOTH2, s = std::sqrt(std::sqrt(std::sqrt(e)));
        phi[r] = d * s;
        qa[r] = g * s * (1.0 + 0.25 * d * d / e);
        qb[r] = -qa[r];
        q[r] = g * phi[r];
    }
}

void power_rows(const Rows& x, int first, int last) {
    for (int r = first; r < last; ++r) {
        const double d = x.t[x.a[r]] - x.t[x.b[r]], g = x.c[x.c0[r]], c1 = x.c[x.c1[r]], e = d * d + SMOOTH2, s = power(e, 0.5 * c1);
        x.phi[r] = d * s;
        x.qa[r] = g * s * (1.0 + c1 * d * d / e);
        x.qb[r] = -x.qa[r];
        x.q[r] = g * x.phi[r];
    }
}

THERMID_CLONES void radiation_rows(const Rows x, int first, int last) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT c = x.c;
    double *THERMID_RESTRICT q = x.q, *THERMID_RESTRICT phi = x.phi, *THERMID_RESTRICT qa = x.qa, *THERMID_RESTRICT qb = x.qb;
    for (int r = first; r < last; ++r) {
        const double ta = t[a[r]], tb = t[b[r]], a2 = ta * ta, b2 = tb * tb, g = c[c0[r]];
        phi[r] = (a2 + b2) * (ta + tb) * (ta - tb);
        qa[r] = 4.0 * g * a2 * ta;
        qb[r] = -4.0 * g * b2 * tb;
        q[r] = g * phi[r];
    }
}

void table_rows(const Rows& x, const int* table, const Table* tables, int* piece, bool mean, int first, int last) {
    for (int r = first; r < last; ++r) {
        const double ta = x.t[x.a[r]], tb = x.t[x.b[r]], d = ta - tb, c = x.c[x.c0[r]];
        double g, g1;
        tables[table[r]].eval(mean ? (ta + tb) * 0.5 : d, g, g1, piece[r]);
        const double bend = (mean ? 0.5 : 1.0) * g1 * d;
        x.phi[r] = g * d;
        x.qa[r] = c * (bend + g);
        x.qb[r] = mean ? c * (bend - g) : -x.qa[r];
        x.q[r] = c * x.phi[r];
    }
}

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
    for (int r = 0; r < p->load.size(); ++r) loads[r] += w * (power[r] - slope[r] * delta[p->load.sensor[r]]);
}

void Evaluation::lean(double w, const double* dir, double* conductors, double* loads) const {
    for (int r = 0; r < p->con.size(); ++r) conductors[r] += w * (qa[r] * dir[p->con.a[r]] + qb[r] * dir[p->con.b[r]]);
    for (int r = 0; r < p->load.size(); ++r) loads[r] += w * slope[r] * dir[p->load.sensor[r]];
}

void Evaluation::rows() {
    const Conductors& c = p->con;
    const int* first = p->kind_begin;
    const Rows x{c.a.data(), c.b.data(), c.c0.data(), c.c1.data(), t.data(), ceff.data(), q.data(), phi.data(), qa, qb};
    linear_rows(x, first[LINEAR], first[POWER]);
    if (quarter) quarter_rows(x, first[POWER], first[RADIATION]);
    else power_rows(x, first[POWER], first[RADIATION]);
    radiation_rows(x, first[RADIATION], first[FLOW]);
    table_rows(x, c.table.data(), p->tables.data(), piece.data(), true, first[TABLE_MEAN], first[TABLE_DIFF]);
    table_rows(x, c.table.data(), p->tables.data(), piece.data(), false, first[TABLE_DIFF], first[GAS]);
    linear_rows(x, first[FLOW], first[TABLE_MEAN]);
    for (int r = first[GAS]; r < c.size(); ++r) {
        const auto y = conductor<double>(c.kind[r], t[c.a[r]], t[c.b[r]], ceff[c.c0[r]], ceff[c.c1[r]], c.table[r] >= 0 ? &p->tables[c.table[r]] : nullptr);
        q[r] = y.q;
        phi[r] = y.phi;
        qa[r] = y.qa;
        qb[r] = y.qb;
    }
    const int *begin = p->meet_begin.data(), *row = p->meet_row.data();
    const double* heat = q.data();
    negatives(q.data(), c.size());
    for (int i = 0, k = 0; i < p->n; ++i) {
        double s = 0.0;
        for (const int end = begin[i + 1]; k < end; ++k) s += heat[row[k]];
        f[i] = s;
    }
    const Loads& ld = p->load;
    const double* ce = ceff.data();
    for (int r = 0; r < ld.size(); ++r) {
        if (ld.kind[r] == SIGNAL) {
            f[ld.node[r]] += power[r] = ce[ld.c[0][r]];
            continue;
        }
        const double cs[4] = {ce[ld.c[0][r]], ce[ld.c[1][r]], ce[ld.c[2][r]], ce[ld.c[3][r]]};
        const auto y = thermid::load<double>(ld.kind[r], t[ld.sensor[r]], cs, ld.table[r] >= 0 ? &p->tables[ld.table[r]] : nullptr, on[r]);
        power[r] = y.p;
        slope[r] = y.pt;
        f[ld.node[r]] += y.p;
    }
}

void Problem::sum_slopes(double* qab, const double* loads, double* v) const {
    negatives(qab, 2 * con.size());
    const int* first = slope_first.data();
    for (int i = 0, m = pattern.size(); i < m; ++i) v[i] = qab[first[i]];
    const int *k = slope_further.data(), *end = k + slope_further.size();
    for (; k != end; k += 2) v[k[0]] += qab[k[1]];
    for (int r = 0; r < load.size(); ++r)
        if (load_place[r] >= 0) v[load_place[r]] += loads[r];
}

void Evaluation::slopes(double* v) { p->sum_slopes(qab.data(), slope.data(), v); }

void Evaluation::jacobian(double* j) const {
    const int n = p->n;
    std::fill(j, j + static_cast<size_t>(n) * n, 0.0);
    const Conductors& c = p->con;
    for (int r = 0; r < c.size(); ++r) {
        const size_t a = c.a[r], b = c.b[r];
        if (c.a[r] < n && c.kind[r] != FLOW) {
            j[a * n + a] -= qa[r];
            if (c.b[r] < n) j[a * n + b] -= qb[r];
        }
        if (c.b[r] < n) {
            if (c.a[r] < n) j[b * n + a] += qa[r];
            j[b * n + b] += qb[r];
        }
    }
    const Loads& l = p->load;
    for (int r = 0; r < l.size(); ++r)
        if (slope[r] != 0.0 && l.sensor[r] < n) j[static_cast<size_t>(l.node[r]) * n + l.sensor[r]] += slope[r];
}

}  // namespace thermid
