// Second derivatives of the heats in one direction: what the dense output's sensitivities need.
#include <algorithm>
#include <cmath>

#include "network/followers.hpp"

namespace thermid {

SecondOrder::SecondOrder(const Problem& p) {
    dt_.assign(p.nodes(), 0.0);
    dc_.assign(p.nc + 3, 0.0);
    for (auto* v : {&d0_, &d1_}) v->assign(p.con.size(), 0.0);
    dab_.assign(4 * static_cast<size_t>(p.con.size()) + 1, 0.0);
    da_ = dab_.data();
    db_ = da_ + p.con.size();
    dl_.assign(2 * p.load.size(), 0.0);
    dlc_.assign(9 * static_cast<size_t>(p.load.size()), 0.0);
    du_.assign(p.inputs.size(), 0.0);
    factor_.assign(p.factors.size(), 0.0);
    bend_.assign(p.factors.size(), 0.0);
    for (const Drive& x : p.followers) pull_.emplace_back(x.nodes.size(), 0.0);
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

// Directions of factors, of the inputs that follow them and of their coefficients; those of temperatures and other inputs stand.
void SecondOrder::follow(const Evaluation& at, const double* dir_u) {
    const Problem& p = *at.p;
    for (size_t k = 0; k < du_.size(); ++k) du_[k] = dir_u && p.inputs[k].kind != FOLLOWED ? dir_u[k] : 0.0;
    for (size_t k = 0; k < factor_.size(); ++k) {
        const Factor& x = p.factors[k];
        factor_[k] = bend_[k] = 0.0;
        if (x.kind == OF_STATE) continue;
        double z = dc_[x.of.c0];
        for (int m = 0; m < 3; ++m)
            if (const int i = x.of.node[m]; i >= 0) z += at.ceff[x.of.c[m]] * dt_[i] + dc_[x.of.c[m]] * at.t[i];
        factor_[k] = at.bend[k] * z;
        if (x.kind != LOOKUP) continue;
        double v, slope, second;
        p.tables[x.table].eval(at.probe(x.of), v, slope, second);
        bend_[k] = second * z;
    }
    for (const Drive& f : p.followers) {
        double whole = 1.0, rise = 0.0;
        for (size_t k = 0; k < f.factors.size(); ++k) {
            rise += factor_[f.factors[k]] * at.others(f, k);
            whole *= at.factor[f.factors[k]];
        }
        du_[f.input] = rise + (f.base < 0 ? 0.0 : whole * du_[f.base]);
        for (int j : f.coefs) dc_[j] = at.coef[j] * du_[f.input];
    }
    for (int k = 0; k < p.nb; ++k) dt_[p.n + k] = dc_[p.gain[k]] + dc_[p.offset[k]];
}

// What followers add: to the direction of the Jacobian, and to that of df/dp by the coefficients of factors.
void SecondOrder::followed(const Evaluation& at, const CoefJacobian& d, double* jacobian, double* g) {
    const Problem& p = *at.p;
    const double* of[2] = {da_, db_};
    for (size_t f = 0; f < p.followers.size(); ++f) {
        const Drive& own = p.followers[f];
        std::vector<double>& pull = pull_[f];
        std::fill(pull.begin(), pull.end(), 0.0);
        for (const Entry& e : own.con) {
            const double v = at.coef[e.coef] * (e.what == 0 ? d0_[e.row] : e.what == 1 ? d1_[e.row] : of[e.what - 4][e.row]);
            const int a = p.con.a[e.row], b = p.con.b[e.row];
            if (b < p.n) pull[own.place[b]] += v;
            if (a < p.n && !is(p.con.kind[e.row], ONE_WAY)) pull[own.place[a]] -= v;
        }
        for (const Entry& e : own.load) pull[own.place[p.load.node[e.row]]] += at.coef[e.coef] * dlc_[9 * static_cast<size_t>(e.row) + e.what];
        for (size_t k = 0; k < own.factors.size(); ++k) {
            const int index = own.factors[k];
            const Factor& x = p.factors[index];
            const double rest = at.others(own, k);
            double turned = f < pull_.size() && own.base >= 0 ? du_[own.base] : 0.0;  // direction of the rest
            for (size_t i = 0; i < own.factors.size(); ++i)
                if (i != k && own.base >= 0) turned *= at.factor[own.factors[i]];
            for (size_t i = 0; i < own.factors.size(); ++i) {
                if (i == k) continue;
                double part = factor_[own.factors[i]] * (own.base < 0 ? 1.0 : at.u[own.base]);
                for (size_t j = 0; j < own.factors.size(); ++j)
                    if (j != k && j != i) part *= at.factor[own.factors[j]];
                turned += part;
            }
            const double by = at.bend[index] * rest, bent = bend_[index] * rest + at.bend[index] * turned;
            for (size_t i = 0; x.kind != OF_STATE && i < own.nodes.size(); ++i)
                for (int m = 0; m < 3; ++m) {
                    const int to = own.entry[(i * own.factors.size() + k) * 3 + m];
                    if (to < 0) continue;
                    const double c = at.ceff[x.of.c[m]];
                    jacobian[to] += pull[i] * by * c + at.pull[f][i] * (bent * c + by * dc_[x.of.c[m]]);
                }
            auto put = [&](int c, double slope, double change) {
                if (c >= p.nc || !d.any(c)) return;
                const int in = p.coef_input[c];
                const double first = slope * (in < 0 ? 1.0 : at.u[in]), second = change * (in < 0 ? 1.0 : at.u[in]) + (in < 0 ? 0.0 : slope * du_[in]);
                for (size_t i = 0; i < own.nodes.size(); ++i) {
                    const double v = (pull[i] * rest + at.pull[f][i] * turned) * first + at.pull[f][i] * rest * second;
                    for (int q = d.indptr[c]; q < d.indptr[c + 1]; ++q) g[static_cast<size_t>(own.nodes[i]) * d.np + d.indices[q]] += v * d.data[q];
                }
            };
            if (x.kind == OF_STATE || (x.kind == CLAMP && at.bend[index] == 0.0)) {  // one coefficient as it is
                at.factor_slope(index, [&](int c, double) { put(c, 1.0, 0.0); });
                continue;
            }
            const double slope = at.bend[index], change = bend_[index];
            put(x.of.c0, slope, change);
            for (int m = 0; m < 3; ++m) {
                const int i = x.of.node[m];
                if (i < 0) continue;
                put(x.of.c[m], slope * at.t[i], change * at.t[i] + slope * dt_[i]);
                if (i < p.n) continue;
                const double c = at.ceff[x.of.c[m]];
                put(p.gain[i - p.n], slope * c, change * c + slope * dc_[x.of.c[m]]);
                put(p.offset[i - p.n], slope * c, change * c + slope * dc_[x.of.c[m]]);
            }
        }
    }
}

bool SecondOrder::add(const Evaluation& at, const double* dir_t, const double* dir_u, Scatter& s, double* jacobian, double* g) {
    const Problem& p = *at.p;
    for (int j : p.timed) dc_[j] = dir_u ? at.coef[j] * dir_u[p.coef_input[j]] : 0.0;
    std::copy(dir_t, dir_t + p.n, dt_.begin());
    for (int k = 0; k < p.nb; ++k) dt_[p.n + k] = dc_[p.gain[k]] + dc_[p.offset[k]];
    const bool follows = !p.followers.empty();
    if (follows) {
        follow(at, dir_u);
        dir_u = du_.data();
    }
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
    if (!follows && std::none_of(da_, da_ + 2 * static_cast<size_t>(p.con.size()), moves) && std::none_of(dl_.begin(), dl_.end(), moves)) return false;
    p.sum_slopes(dab_.data(), dl_.data(), jacobian);
    if (follows) followed(at, *s.derivatives, jacobian, g);
    return true;
}

}  // namespace thermid
