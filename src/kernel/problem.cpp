#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace thermid {

namespace {
void require(bool ok, const std::string& message) {
    if (!ok) throw std::invalid_argument(message);
}
std::string at(const char* what, int i) { return std::string(what) + " " + std::to_string(i); }
}  // namespace

void Problem::prepare() {
    require(n > 0, "a problem needs at least one node");
    for (int j = 0; j < nc; ++j)
        require(coef_input[j] >= -1 && coef_input[j] < static_cast<int>(inputs.size()), at("coef_input: no such input, coefficient", j));
    for (int i = 0; i < n; ++i) {
        require(capacity[i] >= -1 && capacity[i] < nc, at("capacity: no such coefficient, node", i));
        require(capacity[i] < 0 || coef_input[capacity[i]] < 0, at("capacity: a capacitance cannot follow an input, node", i));
        if (capacity[i] < 0) massless.push_back(i);
    }
    auto slot = [&](int& c, int missing, const std::string& where) {
        require(c >= -1 && c < nc, where + ": no such coefficient");
        if (c < 0) c = missing;
    };
    for (int k = 0; k < nb; ++k) {
        slot(gain[k], nc, at("boundary", k));
        slot(offset[k], nc, at("boundary", k));
    }
    const int m = con.size();
    for (int r = 0; r < m; ++r) {
        const std::string where = at("conductor", r);
        require(con.kind[r] >= 0 && con.kind[r] < CONDUCTOR_KINDS, where + ": no such kind");
        require(con.a[r] >= 0 && con.a[r] < nodes() && con.b[r] >= 0 && con.b[r] < nodes(), where + ": no such node");
        require(con.a[r] != con.b[r], where + ": both ends are one node");
        const bool tabled = con.kind[r] == TABLE_MEAN || con.kind[r] == TABLE_DIFF;
        require(!tabled || (con.table[r] >= 0 && con.table[r] < static_cast<int>(tables.size())), where + ": no such table");
        slot(con.c0[r], nc, where);
        slot(con.c1[r], nc, where);
    }
    std::vector<int> order(m);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return con.kind[x] < con.kind[y]; });
    auto permute = [&](std::vector<int>& v) {
        std::vector<int> w(m);
        for (int r = 0; r < m; ++r) w[r] = v[order[r]];
        v = w;
    };
    for (auto* v : {&con.kind, &con.a, &con.b, &con.c0, &con.c1, &con.table}) permute(*v);
    con.original = order;
    for (int k = 0; k <= CONDUCTOR_KINDS; ++k)
        kind_begin[k] = static_cast<int>(std::lower_bound(con.kind.begin(), con.kind.end(), k) - con.kind.begin());

    // Rows that meet at each node, in the order of rows: counted, then filled.
    auto meets = [&](int r, int i) { return i < n && (con.b[r] == i || con.kind[r] != FLOW); };
    meet_begin.assign(n + 1, 0);
    for (int r = 0; r < m; ++r)
        for (int i : {con.a[r], con.b[r]})
            if (meets(r, i)) ++meet_begin[i + 1];
    for (int i = 0; i < n; ++i) meet_begin[i + 1] += meet_begin[i];
    meet_row.resize(meet_begin[n]);
    meet_sign.resize(meet_begin[n]);
    std::vector<int> filled(meet_begin.begin(), meet_begin.end() - 1);
    for (int r = 0; r < m; ++r)
        for (int i : {con.a[r], con.b[r]}) {
            if (!meets(r, i)) continue;
            meet_sign[filled[i]] = con.b[r] == i ? 1.0 : -1.0;
            meet_row[filled[i]++] = r;
        }

    auto boundary_entries = [&](std::vector<Entry>& list, int row, int node, int what) {
        if (node < n) return;
        for (int c : {gain[node - n], offset[node - n]})
            if (c < nc) list.push_back({row, what, c});
    };
    for (int r = 0; r < m; ++r) {
        if (con.c0[r] < nc) con_entry.push_back({r, 0, con.c0[r]});
        if (con.kind[r] == POWER && con.c1[r] < nc) con_entry.push_back({r, 1, con.c1[r]});
        boundary_entries(con_entry, r, con.a[r], 4);
        boundary_entries(con_entry, r, con.b[r], 5);
    }
    for (int r = 0; r < load.size(); ++r) {
        const std::string where = at("load", r);
        require(load.kind[r] >= 0 && load.kind[r] < LOAD_KINDS, where + ": no such kind");
        require(load.node[r] >= 0 && load.node[r] < n, where + ": a load needs an unknown node");
        require(load.sensor[r] >= 0 && load.sensor[r] < nodes(), where + ": no such sensor node");
        require(load.kind[r] != TABLE || (load.table[r] >= 0 && load.table[r] < static_cast<int>(tables.size())), where + ": no such table");
        for (int k = 0; k < 4; ++k) {
            slot(load.c[k][r], load.kind[r] == PROPORTIONAL && k == 2 ? nc + 1 : nc, where);
            if (load.c[k][r] < nc) load_entry.push_back({r, k, load.c[k][r]});
        }
        boundary_entries(load_entry, r, load.sensor[r], 4);
        if (load.kind[r] == THERMOSTAT) thermostats.push_back(r);
    }
    for (int j = 0; j < nc; ++j)
        if (coef_input[j] >= 0) {
            timed.push_back(j);
            if (inputs[coef_input[j]].kind != CONSTANT) moved.push_back(j);
        }
    for (size_t k = 0; k < inputs.size(); ++k)
        if (inputs[k].kind != CONSTANT) moving.push_back(static_cast<int>(k));
    find_pattern();
}

void Problem::find_pattern() {
    if (n > LARGEST) return;
    std::vector<std::vector<int>> cols(n);
    for (int r = 0; r < con.size(); ++r) {
        if (con.a[r] >= n || con.b[r] >= n) continue;
        cols[con.b[r]].push_back(con.a[r]);
        if (con.kind[r] != FLOW) cols[con.a[r]].push_back(con.b[r]);
    }
    for (int r = 0; r < load.size(); ++r)
        if (load.sensor[r] < n && load.kind[r] != SIGNAL) cols[load.node[r]].push_back(load.sensor[r]);
    pattern.build(n, cols);
    elimination.build(pattern);
    struct Part { int row, end; double sign; };
    std::vector<std::vector<Part>> parts(pattern.size());
    auto add = [&](int i, int j, Part part) {
        if (i < n && j < n) parts[pattern.at(i, j)].push_back(part);
    };
    for (int r = 0; r < con.size(); ++r) {
        const int a = con.a[r], b = con.b[r];
        add(b, a, {r, 0, 1.0});
        add(b, b, {r, 1, 1.0});
        if (con.kind[r] == FLOW) continue;
        add(a, a, {r, 0, -1.0});
        add(a, b, {r, 1, -1.0});
    }
    slope_begin.assign(1, 0);
    for (const auto& list : parts) {
        for (const Part& x : list) {
            slope_row.push_back(x.row);
            slope_end.push_back(x.end);
            slope_sign.push_back(x.sign);
        }
        slope_begin.push_back(static_cast<int>(slope_row.size()));
    }
    for (int r = 0; r < load.size(); ++r)
        load_place.push_back(load.sensor[r] < n && load.kind[r] != SIGNAL ? pattern.at(load.node[r], load.sensor[r]) : -1);
}

Evaluation::Evaluation(const Problem& problem, const double* coefficients) : p(&problem), coef(coefficients) {
    const size_t m = p->con.size(), l = p->load.size();
    u.assign(p->inputs.size(), 0.0);
    ceff.assign(coef, coef + p->nc);
    ceff.push_back(0.0);
    ceff.push_back(std::numeric_limits<double>::infinity());
    t.assign(p->nodes(), 0.0);
    for (auto* v : {&q, &phi, &qa, &qb}) v->assign(m, 0.0);
    power.assign(l, 0.0);
    slope.assign(l, 0.0);
    on.assign(l, 0);
    f.assign(p->nodes(), 0.0);
    quarter = true;
    for (int r = p->kind_begin[POWER]; r < p->kind_begin[POWER + 1]; ++r) {
        const int c = p->con.c1[r];
        quarter = quarter && ceff[c] == 0.25 && p->coef_input[c] < 0;
    }
}

void Evaluation::set_inputs() {
    for (int j : p->timed) ceff[j] = coef[j] * u[p->coef_input[j]];
    for (int k = 0; k < p->nb; ++k) t[p->n + k] = ceff[p->gain[k]] + ceff[p->offset[k]];
}

void Evaluation::move_inputs() {
    for (int j : p->moved) ceff[j] = coef[j] * u[p->coef_input[j]];
    for (int k = 0; k < p->nb; ++k) t[p->n + k] = ceff[p->gain[k]] + ceff[p->offset[k]];
}

double Evaluation::con_slope(const Entry& e) const {
    switch (e.what) {
        case 0: return phi[e.row];
        case 1: return conductor_exponent<double>(t[p->con.a[e.row]], t[p->con.b[e.row]], q[e.row]);
        case 4: return qa[e.row];
        default: return qb[e.row];
    }
}

double Evaluation::load_slope(const Entry& e) const {
    if (e.what == 4) return slope[e.row];
    const Loads& ld = p->load;
    const int r = e.row;
    if (ld.kind[r] == SIGNAL) return 1.0;
    const double cs[4] = {ceff[ld.c[0][r]], ceff[ld.c[1][r]], ceff[ld.c[2][r]], ceff[ld.c[3][r]]};
    return thermid::load<double>(ld.kind[r], t[ld.sensor[r]], cs, ld.table[r] >= 0 ? &p->tables[ld.table[r]] : nullptr, on[r]).pc[e.what];
}

void Evaluation::add_parameters(const CoefJacobian& d, const std::vector<Entry>& con, const std::vector<Entry>& load, double* fp,
                                double scale) const {
    const int n = p->n, np = d.np;
    auto scatter = [&](int node, int coef, double v) {
        if (node >= n || v == 0.0) return;
        for (int k = d.indptr[coef]; k < d.indptr[coef + 1]; ++k) fp[static_cast<size_t>(node) * np + d.indices[k]] += v * d.data[k];
    };
    for (const Entry& e : con) {
        const int in = p->coef_input[e.coef];
        const double v = scale * con_slope(e) * (in < 0 ? 1.0 : u[in]);
        scatter(p->con.b[e.row], e.coef, v);
        if (p->con.kind[e.row] != FLOW) scatter(p->con.a[e.row], e.coef, -v);
    }
    for (const Entry& e : load) {
        const int in = p->coef_input[e.coef];
        scatter(p->load.node[e.row], e.coef, scale * load_slope(e) * (in < 0 ? 1.0 : u[in]));
    }
}

void Evaluation::input_slopes(const std::vector<Entry>& con, const std::vector<Entry>& load, double* fu) const {
    const int n = p->n;
    std::fill(fu, fu + p->inputs.size() * n, 0.0);
    for (const Entry& e : con) {
        double* to = fu + static_cast<size_t>(p->coef_input[e.coef]) * n;
        const double v = con_slope(e) * coef[e.coef];
        if (p->con.b[e.row] < n) to[p->con.b[e.row]] += v;
        if (p->con.kind[e.row] != FLOW && p->con.a[e.row] < n) to[p->con.a[e.row]] -= v;
    }
    for (const Entry& e : load) fu[static_cast<size_t>(p->coef_input[e.coef]) * n + p->load.node[e.row]] += load_slope(e) * coef[e.coef];
}

SecondOrder::SecondOrder(const Problem& p) {
    const size_t m = std::max(p.con.size(), p.load.size());
    dt_.assign(p.nodes(), 0.0);
    dc_.assign(p.nc + 2, 0.0);
    for (auto* v : {&da_, &db_, &d0_, &d1_}) v->assign(m, 0.0);
}

THERMID_CLONES static void add_scaled(double* THERMID_RESTRICT y, double a, const double* THERMID_RESTRICT x, int m) {
    for (int k = 0; k < m; ++k) y[k] += a * x[k];
}

void SecondOrder::add(const Evaluation& at, const double* dir_t, const double* dir_u, const CoefJacobian& d, const std::vector<Entry>& con,
                      const std::vector<Entry>& load, const double* s, double* g) {
    const Problem& p = *at.p;
    const int n = p.n, np = d.np;
    exponents_ = std::any_of(con.begin(), con.end(), [](const Entry& e) { return e.what == 1; });
    for (int j : p.timed) dc_[j] = dir_u ? at.coef[j] * dir_u[p.coef_input[j]] : 0.0;
    std::copy(dir_t, dir_t + n, dt_.begin());
    for (int k = 0; k < p.nb; ++k) dt_[n + k] = dc_[p.gain[k]] + dc_[p.offset[k]];
    // v is added to df of the node, for parameter row x.
    auto add_row = [&](int node, double v, const double* x) {
        if (node >= n || v == 0.0) return;
        double* to = g + static_cast<size_t>(node) * np;
        add_scaled(to, v, x, np);
    };
    auto add_coef = [&](int node, double v, int coef) {
        if (node >= n || v == 0.0) return;
        for (int k = d.indptr[coef]; k < d.indptr[coef + 1]; ++k) g[static_cast<size_t>(node) * np + d.indices[k]] += v * d.data[k];
    };
    const Conductors& c = p.con;
    for (int r = 0; r < c.size(); ++r) {
        const int a = c.a[r], b = c.b[r];
        da_[r] = db_[r] = d0_[r] = d1_[r] = 0.0;
        const double e0 = dc_[c.c0[r]], e1 = dc_[c.c1[r]];
        if (dt_[a] == 0.0 && dt_[b] == 0.0 && e0 == 0.0 && e1 == 0.0) continue;
        const Dual ta(at.t[a], dt_[a]), tb(at.t[b], dt_[b]), c0(at.ceff[c.c0[r]], e0), c1(at.ceff[c.c1[r]], e1);
        if (c.kind[r] == LINEAR || c.kind[r] == FLOW) {
            da_[r] = e0;
            db_[r] = -e0;
            d0_[r] = dt_[a] - dt_[b];
        } else if (c.kind[r] == RADIATION) {
            const double a2 = at.t[a] * at.t[a], b2 = at.t[b] * at.t[b], g = at.ceff[c.c0[r]];
            da_[r] = 4.0 * a2 * (3.0 * g * dt_[a] + e0 * at.t[a]);
            db_[r] = -4.0 * b2 * (3.0 * g * dt_[b] + e0 * at.t[b]);
            d0_[r] = 4.0 * (a2 * at.t[a] * dt_[a] - b2 * at.t[b] * dt_[b]);
        } else if (c.kind[r] == POWER && e1 == 0.0 && !exponents_) {
            // q_a = g s (1 + m d^2 / e) with e = d^2 + smoothing, s = e^(m/2), phi = d s
            const double d = at.t[a] - at.t[b], v = dt_[a] - dt_[b], e = d * d + SMOOTH2, m = at.ceff[c.c1[r]], g = at.ceff[c.c0[r]];
            const double phi = at.phi[r], part = d * d / e, s = d != 0.0 ? phi / d : power(e, 0.5 * m);
            da_[r] = g * m * phi / e * (3.0 + (m - 2.0) * part) * v + e0 * s * (1.0 + m * part);
            db_[r] = -da_[r];
            d0_[r] = s * (1.0 + m * part) * v;
        } else {
            const auto x = conductor<Dual>(c.kind[r], ta, tb, c0, c1, c.table[r] >= 0 ? &p.tables[c.table[r]] : nullptr);
            da_[r] = x.qa.e;
            db_[r] = x.qb.e;
            d0_[r] = x.phi.e;
            if (c.kind[r] == POWER) d1_[r] = conductor_exponent<Dual>(ta, tb, x.q).e;
        }
        const bool both = c.kind[r] != FLOW;
        if (a < n) {
            add_row(b, da_[r], s + static_cast<size_t>(a) * np);
            if (both) add_row(a, -da_[r], s + static_cast<size_t>(a) * np);
        }
        if (b < n) {
            add_row(b, db_[r], s + static_cast<size_t>(b) * np);
            if (both) add_row(a, -db_[r], s + static_cast<size_t>(b) * np);
        }
    }
    for (const Entry& e : con) {
        const int in = p.coef_input[e.coef];
        const double second = e.what == 0 ? d0_[e.row] : e.what == 1 ? d1_[e.row] : e.what == 4 ? da_[e.row] : db_[e.row];
        double v = second * (in < 0 ? 1.0 : at.u[in]);
        if (in >= 0 && dir_u) v += at.con_slope(e) * dir_u[in];
        add_coef(c.b[e.row], v, e.coef);
        if (c.kind[e.row] != FLOW) add_coef(c.a[e.row], -v, e.coef);
    }
    const Loads& ld = p.load;
    for (int r = 0; r < ld.size(); ++r) {
        da_[r] = 0.0;
        const int kind = ld.kind[r];
        if (kind == SIGNAL || kind == THERMOSTAT) continue;
        Dual cs[4];
        for (int k = 0; k < 4; ++k) cs[k] = Dual(at.ceff[ld.c[k][r]], dc_[ld.c[k][r]]);
        const auto x = thermid::load<Dual>(kind, Dual(at.t[ld.sensor[r]], dt_[ld.sensor[r]]), cs,
                                           ld.table[r] >= 0 ? &p.tables[ld.table[r]] : nullptr, at.on[r]);
        da_[r] = x.pt.e;
        if (ld.sensor[r] < n) add_row(ld.node[r], x.pt.e, s + static_cast<size_t>(ld.sensor[r]) * np);
        for (int k = 0; k < 4; ++k)
            if (ld.c[k][r] < p.nc && d.any(ld.c[k][r])) {
                const int in = p.coef_input[ld.c[k][r]];
                add_coef(ld.node[r], x.pc[k].e * (in < 0 ? 1.0 : at.u[in]), ld.c[k][r]);
            }
    }
    for (const Entry& e : load) {
        const int in = p.coef_input[e.coef];
        double v = e.what == 4 ? da_[e.row] * (in < 0 ? 1.0 : at.u[in]) : 0.0;
        if (in >= 0 && dir_u) v += at.load_slope(e) * dir_u[in];
        add_coef(ld.node[e.row], v, e.coef);
    }
}

}  // namespace thermid
