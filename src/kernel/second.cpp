// Second derivatives of the heats in one direction: what the dense output's sensitivities need.
#include <algorithm>
#include <cmath>

#include "problem.hpp"

namespace thermid {

SecondOrder::SecondOrder(const Problem& p) {
    dt_.assign(p.nodes(), 0.0);
    dc_.assign(p.nc + 2, 0.0);
    for (auto* v : {&d0_, &d1_}) v->assign(p.con.size(), 0.0);
    dab_.assign(4 * static_cast<size_t>(p.con.size()) + 1, 0.0);
    da_ = dab_.data();
    db_ = da_ + p.con.size();
    dl_.assign(p.load.size(), 0.0);
    dlc_.assign(4 * static_cast<size_t>(p.load.size()), 0.0);
}

namespace {

// Where conductors stand, the direction, and what is found for each.
struct Seconds {
    const int *a, *b, *c0;
    const double *t, *dt, *c, *dc, *phi;
    double *da, *db, *d0;
};

// q_a = g s (1 + m d^2 / e) with e = d^2 + smoothing, s = e^(m/2), phi = d s, and m = 1/4
THERMID_CLONES void quarter_seconds(const Seconds x, int first, int last, double rest) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT dt = x.dt, *THERMID_RESTRICT c = x.c, *THERMID_RESTRICT dc = x.dc;
    const double* THERMID_RESTRICT phi = x.phi;
    double *THERMID_RESTRICT da = x.da, *THERMID_RESTRICT db = x.db, *THERMID_RESTRICT d0 = x.d0;
    for (int r = first; r < last; ++r) {
        const double d = t[a[r]] - t[b[r]], v = dt[a[r]] - dt[b[r]], e = 1.0 / (d * d + SMOOTH2), part = d * d * e;
        const double s = d != 0.0 ? phi[r] / d : rest, rise = s * (1.0 + 0.25 * part);
        da[r] = c[c0[r]] * 0.25 * phi[r] * e * (3.0 - 1.75 * part) * v + dc[c0[r]] * rise;
        db[r] = -da[r];
        d0[r] = rise * v;
    }
}

THERMID_CLONES void radiation_seconds(const Seconds x, int first, int last) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT dt = x.dt, *THERMID_RESTRICT c = x.c, *THERMID_RESTRICT dc = x.dc;
    double *THERMID_RESTRICT da = x.da, *THERMID_RESTRICT db = x.db, *THERMID_RESTRICT d0 = x.d0;
    for (int r = first; r < last; ++r) {
        const double ta = t[a[r]], tb = t[b[r]], va = dt[a[r]], vb = dt[b[r]], a2 = ta * ta, b2 = tb * tb, g = c[c0[r]], e0 = dc[c0[r]];
        da[r] = 4.0 * a2 * (3.0 * g * va + e0 * ta);
        db[r] = -4.0 * b2 * (3.0 * g * vb + e0 * tb);
        d0[r] = 4.0 * (a2 * ta * va - b2 * tb * vb);
    }
}

}  // namespace

// Of q_a, q_b and of the heat per coefficient.
void SecondOrder::conductors(const Evaluation& at, bool exponents) {
    const Problem& p = *at.p;
    const Conductors& c = p.con;
    const int *a = c.a.data(), *b = c.b.data(), *first = p.kind_begin;
    const double *t = at.t.data(), *dt = dt_.data();
    auto generic = [&](int r) {
        const Dual ta(t[a[r]], dt[a[r]]), tb(t[b[r]], dt[b[r]]), c0(at.ceff[c.c0[r]], dc_[c.c0[r]]), c1(at.ceff[c.c1[r]], dc_[c.c1[r]]);
        const auto x = conductor<Dual>(c.kind[r], ta, tb, c0, c1, c.table[r] >= 0 ? &p.tables[c.table[r]] : nullptr);
        da_[r] = x.qa.e;
        db_[r] = x.qb.e;
        d0_[r] = x.phi.e;
        d1_[r] = c.kind[r] == POWER ? conductor_exponent<Dual>(ta, tb, x.q).e : x.q1.e;
    };
    for (int r = first[LINEAR]; r < first[POWER]; ++r) {
        da_[r] = dc_[c.c0[r]];
        db_[r] = -da_[r];
        d0_[r] = dt[a[r]] - dt[b[r]];
    }
    const Seconds x{a, b, c.c0.data(), t, dt, at.ceff.data(), dc_.data(), at.phi.data(), da_, db_, d0_.data()};
    const bool quarter = at.quarter && !exponents;
    if (quarter) quarter_seconds(x, first[POWER], first[RADIATION], power(SMOOTH2, 0.125));
    for (int r = first[POWER]; r < first[RADIATION] && !quarter; ++r) {
        if (exponents || dc_[c.c1[r]] != 0.0) {
            generic(r);
            continue;
        }
        const double d = t[a[r]] - t[b[r]], v = dt[a[r]] - dt[b[r]], e = 1.0 / (d * d + SMOOTH2), m = at.ceff[c.c1[r]];
        const double phi = at.phi[r], part = d * d * e, s = d != 0.0 ? phi / d : power(SMOOTH2, 0.5 * m), rise = s * (1.0 + m * part);
        da_[r] = at.ceff[c.c0[r]] * m * phi * e * (3.0 + (m - 2.0) * part) * v + dc_[c.c0[r]] * rise;
        db_[r] = -da_[r];
        d0_[r] = rise * v;
    }
    radiation_seconds(x, first[RADIATION], first[FLOW]);
    for (int r = first[FLOW]; r < c.size(); ++r) generic(r);
}

void SecondOrder::loads(const Evaluation& at) {
    const Problem& p = *at.p;
    const Loads& ld = p.load;
    for (int r = 0; r < ld.size(); ++r) {
        if (ld.kind[r] == SIGNAL || ld.kind[r] == THERMOSTAT) continue;
        Dual cs[4];
        for (int k = 0; k < 4; ++k) cs[k] = Dual(at.ceff[ld.c[k][r]], dc_[ld.c[k][r]]);
        const int sensor = ld.sensor[r];
        const auto x = thermid::load<Dual>(ld.kind[r], Dual(at.t[sensor], dt_[sensor]), cs, ld.table[r] >= 0 ? &p.tables[ld.table[r]] : nullptr,
                                           at.on[r]);
        dl_[r] = x.pt.e;
        for (int k = 0; k < 4; ++k) dlc_[4 * static_cast<size_t>(r) + k] = x.pc[k].e;
    }
}

bool SecondOrder::add(const Evaluation& at, const double* dir_t, const double* dir_u, Scatter& s, double* jacobian, double* g) {
    const Problem& p = *at.p;
    for (int j : p.timed) dc_[j] = dir_u ? at.coef[j] * dir_u[p.coef_input[j]] : 0.0;
    std::copy(dir_t, dir_t + p.n, dt_.begin());
    for (int k = 0; k < p.nb; ++k) dt_[p.n + k] = dc_[p.gain[k]] + dc_[p.offset[k]];
    conductors(at, s.exponents);
    loads(at);
    double* value = s.value.data();
    auto by_input = [&](const Entry& e, double second, auto slope) {
        const int in = p.coef_input[e.coef];
        if (in < 0) return second;
        return second * at.u[in] + (dir_u ? slope(e) * dir_u[in] : 0.0);
    };
    const double* of[2] = {da_, db_};
    s.add_plain(d0_.data(), 1.0, g);
    for (const Entry& e : s.other) {
        const double second = e.what == 0 ? d0_[e.row] : e.what == 1 ? d1_[e.row] : of[e.what - 4][e.row];
        *value++ = by_input(e, second, [&](const Entry& x) { return at.con_slope(x); });
    }
    for (const Entry& e : s.load) {
        const double second = e.what == 4 ? dl_[e.row] : dlc_[4 * static_cast<size_t>(e.row) + e.what];
        *value++ = by_input(e, second, [&](const Entry& x) { return at.load_slope(x); });
    }
    s.add(g);
    const auto moves = [](double v) { return v != 0.0; };
    if (std::none_of(da_, da_ + 2 * static_cast<size_t>(p.con.size()), moves) && std::none_of(dl_.begin(), dl_.end(), moves)) return false;
    p.sum_slopes(dab_.data(), dl_.data(), jacobian);
    return true;
}

}  // namespace thermid
