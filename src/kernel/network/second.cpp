// Second derivatives of the heats in one direction: what the dense output's sensitivities need.
#include <algorithm>
#include <cmath>

#include "network/problem.hpp"

namespace thermid {

SecondOrder::SecondOrder(const Problem& p) {
    dt_.assign(p.nodes(), 0.0);
    dc_.assign(p.nc + 2, 0.0);
    for (auto* v : {&d0_, &d1_}) v->assign(p.con.size(), 0.0);
    dab_.assign(4 * static_cast<size_t>(p.con.size()) + 1, 0.0);
    da_ = dab_.data();
    db_ = da_ + p.con.size();
    dl_.assign(2 * p.load.size(), 0.0);
    dlc_.assign(9 * static_cast<size_t>(p.load.size()), 0.0);
}

namespace {

// Where conductors stand, the direction, and what is found for each.
struct Seconds {
    const int *a, *b, *c0, *c1, *table;
    const double *t, *dt, *c, *dc;
    const Table* tables;
    double *da, *db, *d0, *d1;
};

template <class Law, bool SOUGHT, class... C>
THERMID_INLINE void each(const Seconds& x, int first, int last, C... exponent) {
    const int *THERMID_RESTRICT a = x.a, *THERMID_RESTRICT b = x.b, *THERMID_RESTRICT c0 = x.c0, *THERMID_RESTRICT c1 = x.c1;
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT dt = x.dt, *THERMID_RESTRICT c = x.c, *THERMID_RESTRICT dc = x.dc;
    double *THERMID_RESTRICT da = x.da, *THERMID_RESTRICT db = x.db, *THERMID_RESTRICT d0 = x.d0, *THERMID_RESTRICT d1 = x.d1;
    for (int r = first; r < last; ++r) {
        const Dual ta(t[a[r]], dt[a[r]]), tb(t[b[r]], dt[b[r]]), g(c[c0[r]], dc[c0[r]]);
        const Tables tables{x.tables + x.table[r]};
        Conduct<Dual> y;
        if constexpr (sizeof...(C) > 0) y = Law::heat(ta, tb, g, exponent..., tables);
        else y = Law::heat(ta, tb, g, Dual(c[c1[r]], dc[c1[r]]), tables);
        da[r] = y.qa.e;
        db[r] = y.qb.e;
        d0[r] = y.phi.e;
        if (SOUGHT) d1[r] = y.q1.e;
    }
}

#define THERMID_SECONDS(KIND, LAW, ...)                                                                                    \
    THERMID_CLONES void seconds_of_##KIND(const Seconds& x, int first, int last) { each<LAW, false>(x, first, last); }      \
    void sought_seconds_of_##KIND(const Seconds& x, int first, int last) { each<LAW, true>(x, first, last); }
THERMID_CONDUCTORS(THERMID_SECONDS)
#undef THERMID_SECONDS
THERMID_CLONES void quarter_seconds(const Seconds& x, int first, int last) { each<Power, false>(x, first, last, Quarter{}); }

using Pass = void (*)(const Seconds&, int, int);
#define THERMID_SECONDS(KIND, ...) {seconds_of_##KIND, sought_seconds_of_##KIND},
constexpr Pass SECONDS_OF[][2] = {THERMID_CONDUCTORS(THERMID_SECONDS)};
#undef THERMID_SECONDS

}  // namespace

// Of q_a, q_b and of the heat per coefficient; per second coefficient where some of these are sought.
void SecondOrder::conductors(const Evaluation& at, bool exponents) {
    const Problem& p = *at.p;
    const Conductors& c = p.con;
    const Seconds x{c.a.data(), c.b.data(), c.c0.data(), c.c1.data(), c.table.data(), at.t.data(), dt_.data(), at.ceff.data(), dc_.data(),
                    p.tables.data(), da_, db_, d0_.data(), d1_.data()};
    for (int k = 0; k < CONDUCTOR_KINDS; ++k)
        if (p.kind_begin[k] < p.kind_begin[k + 1])
            (k == POWER && at.quarter && !exponents ? quarter_seconds : SECONDS_OF[k][exponents])(x, p.kind_begin[k], p.kind_begin[k + 1]);
}

void SecondOrder::loads(const Evaluation& at) {
    const Loads& ld = at.p->load;
    for (int r = 0; r < ld.size(); ++r) {
        if (ld.kind[r] == SIGNAL && ld.control[r] < 0) continue;
        const auto x = at.load<Dual>(r, [&](int i) { return Dual(at.t[i], dt_[i]); }, [&](int k) { return Dual(at.ceff[k], dc_[k]); });
        dl_[r] = x.pt.e;
        dl_[ld.size() + r] = x.ps.e;
        double* to = dlc_.data() + 9 * static_cast<size_t>(r);
        for (int k = 0; k < 4; ++k) to[k] = x.pc[k].e;
        to[4] = x.pt.e;
        to[5] = x.ps.e;
        for (int k = 0; k < 3; ++k) to[6 + k] = x.sc[k].e;
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
        const double second = dlc_[9 * static_cast<size_t>(e.row) + e.what];
        *value++ = by_input(e, second, [&](const Entry& x) { return at.load_slope(x); });
    }
    s.add(g);
    const auto moves = [](double v) { return v != 0.0; };
    if (std::none_of(da_, da_ + 2 * static_cast<size_t>(p.con.size()), moves) && std::none_of(dl_.begin(), dl_.end(), moves)) return false;
    p.sum_slopes(dab_.data(), dl_.data(), jacobian);
    return true;
}

}  // namespace thermid
