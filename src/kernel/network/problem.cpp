#include "network/problem.hpp"

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

Problem Problem::at_edges(const double* coef) const {
    constexpr double LEAST = 1e-6;  // time between two jumps of an input [s]
    Problem out = *this;
    std::vector<std::pair<size_t, size_t>> places;
    for (const Edge& e : edges) {
        auto& seg = out.inputs[e.input].seg;
        const size_t i = std::lower_bound(inputs[e.input].seg.begin(), inputs[e.input].seg.end(), e.time, [](const auto& x, double t) { return x.t < t; }) - inputs[e.input].seg.begin();
        seg[i].t += coef[e.coef] * e.interval;
        places.push_back({e.input, i});
    }
    for (Input& in : out.inputs)
        for (size_t i = 1; i < in.seg.size() && in.kind == 1; ++i) in.seg[i].t = std::max(in.seg[i].t, in.seg[i - 1].t + LEAST);
    for (size_t k = 0; k < edges.size(); ++k) out.edges[k].time = out.inputs[places[k].first].seg[places[k].second].t;
    for (const Edge& e : edges) out.inputs[e.input].sum_blocks();
    return out;
}

void Problem::prepare() {
    require(n > 0, "a problem needs at least one node");
    for (const Edge& e : edges) {
        require(e.input >= 0 && e.input < static_cast<int>(inputs.size()) && e.coef >= 0 && e.coef < nc, "edges: no such input or coefficient");
        const auto& seg = inputs[e.input].seg;
        require(inputs[e.input].kind == 1 && std::any_of(seg.begin(), seg.end(), [&](const auto& x) { return x.t == e.time; }), "edges: no jump of a held input there");
    }
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
        const int wanted = tables_of(con.kind[r]);
        require(!wanted || (con.table[r] >= 0 && con.table[r] + wanted <= static_cast<int>(tables.size())), where + ": no such table");
        slot(con.c0[r], nc, where);
        slot(con.c1[r], nc, where);
        con.table[r] = std::max(con.table[r], 0);
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
    con.place.assign(1, 0);
    for (int r = 0; r < m; ++r) con.place.push_back(con.place[r] + tables_of(con.kind[r]));
    for (int k = 0; k <= CONDUCTOR_KINDS; ++k)
        kind_begin[k] = static_cast<int>(std::lower_bound(con.kind.begin(), con.kind.end(), k) - con.kind.begin());

    for (int r = 0; r < m; ++r) {
        const int count = tables_of(con.kind[r]);
        auto bent = [&](int k) { return !tables[con.table[r] + k].bends.empty(); };
        if (has_knee(con.kind[r]) && (count == 0 || bent(0) || (count > 1 && bent(1)))) bent_conductors.push_back(r);
    }

    // Rows that meet at each node, in the order of rows: counted, then filled.
    auto meets = [&](int r, int i) { return i < n && (con.b[r] == i || !is(con.kind[r], ONE_WAY)); };
    meet_begin.assign(n + 1, 0);
    for (int r = 0; r < m; ++r)
        for (int i : {con.a[r], con.b[r]})
            if (meets(r, i)) ++meet_begin[i + 1];
    for (int i = 0; i < n; ++i) meet_begin[i + 1] += meet_begin[i];
    meet_row.resize(meet_begin[n]);
    std::vector<int> filled(meet_begin.begin(), meet_begin.end() - 1);
    for (int r = 0; r < m; ++r)
        for (int i : {con.a[r], con.b[r]}) {
            if (!meets(r, i)) continue;
            meet_row[filled[i]++] = con.b[r] == i ? r : m + r;
        }

    auto boundary_entries = [&](std::vector<Entry>& list, int row, int node, int what) {
        if (node < n) return;
        for (int c : {gain[node - n], offset[node - n]})
            if (c < nc) list.push_back({row, what, c});
    };
    for (int r = 0; r < m; ++r) {
        if (con.c0[r] < nc) con_entry.push_back({r, 0, con.c0[r]});
        if (has_second(con.kind[r]) && con.c1[r] < nc) con_entry.push_back({r, 1, con.c1[r]});
        boundary_entries(con_entry, r, con.a[r], 4);
        boundary_entries(con_entry, r, con.b[r], 5);
    }
    control.node.assign(control.size(), -1);
    for (int j = 0; j < control.size(); ++j) {
        const std::string where = at("control", j);
        require(control.kind[j] >= 0 && control.kind[j] < CONTROL_KINDS, where + ": no such kind");
        require(control.sensor[j] >= 0 && control.sensor[j] < nodes(), where + ": no such sensor node");
        for (int k = 0; k < 3; ++k) slot(control.c[k][j], nc, where);
        if (control.kind[j] == THERMOSTAT) thermostats.push_back(j);
    }
    for (int r = 0; r < load.size(); ++r) {
        const std::string where = at("load", r);
        require(load.kind[r] >= 0 && load.kind[r] < LOAD_KINDS, where + ": no such kind");
        require(load.node[r] >= 0 && load.node[r] < n, where + ": a load needs an unknown node");
        require(load.sensor[r] >= 0 && load.sensor[r] < nodes(), where + ": no such sensor node");
        require(!LOAD_LAWS[load.kind[r]].tables || (load.table[r] >= 0 && load.table[r] < static_cast<int>(tables.size())), where + ": no such table");
        load.table[r] = std::max(load.table[r], 0);
        for (int k = 0; k < 4; ++k) {
            slot(load.c[k][r], nc, where);
            if (load.c[k][r] < nc) load_entry.push_back({r, k, load.c[k][r]});
        }
        boundary_entries(load_entry, r, load.sensor[r], 4);
        const int j = load.control[r];
        require(j >= -1 && j < control.size(), where + ": no such control");
        if ((j >= 0 && control.kind[j] == PROPORTIONAL) || (LOAD_LAWS[load.kind[r]].tables && !tables[load.table[r]].bends.empty())) bent_loads.push_back(r);
        if (j < 0) continue;
        if (control.node[j] < 0) control.node[j] = load.node[r];
        boundary_entries(load_entry, r, control.sensor[j], 5);
        for (int k = 0; k < 3; ++k)
            if (control.c[k][j] < nc && !(k == 2 && limited(r))) load_entry.push_back({r, 6 + k, control.c[k][j]});
    }
    load.felt = load.sensor;
    for (int r = 0; r < load.size(); ++r) load.felt.push_back(load.control[r] < 0 ? load.sensor[r] : control.sensor[load.control[r]]);
    for (int j = 0; j < nc; ++j)
        if (coef_input[j] >= 0) {
            timed.push_back(j);
            if (inputs[coef_input[j]].kind != CONSTANT && inputs[coef_input[j]].kind != FOLLOWED) moved.push_back(j);
        }
    for (size_t k = 0; k < inputs.size(); ++k)
        if (inputs[k].kind != CONSTANT && inputs[k].kind != FOLLOWED) moving.push_back(static_cast<int>(k));
    prepare_controls();
    find_pattern();
}

void Problem::find_pattern() {
    if (n > LARGEST) return;
    std::vector<std::vector<int>> cols(n);
    for (int r = 0; r < con.size(); ++r) {
        if (con.a[r] >= n || con.b[r] >= n) continue;
        cols[con.b[r]].push_back(con.a[r]);
        if (!is(con.kind[r], ONE_WAY)) cols[con.a[r]].push_back(con.b[r]);
    }
    // Whether a load's power follows the temperature of its law (r), or of its control's sensor (their number + r).
    auto follows = [&](int k) {
        const int r = k % load.size();
        return load.felt[k] < n && (k < load.size() ? load.kind[r] != SIGNAL : load.control[r] >= 0 && control.kind[load.control[r]] != THERMOSTAT);
    };
    const int felt = 2 * load.size();
    for (int k = 0; k < felt; ++k)
        if (follows(k)) cols[load.node[k % load.size()]].push_back(load.felt[k]);
    for (const Drive& f : followers)
        for (int i : f.nodes)
            for (int x : f.factors)
                for (int at : factors[x].of.node)
                    if (factors[x].kind != OF_STATE && at >= 0 && at < n) cols[i].push_back(at);
    pattern.build(n, cols);
    if (n <= LARGEST) elimination.build(pattern);
    else elimination.full = true;  // no integrator that needs an order takes it
    struct Part { int row, end; double sign; };
    std::vector<std::vector<Part>> parts(pattern.size());
    auto add = [&](int i, int j, Part part) {
        if (i < n && j < n) parts[pattern.at(i, j)].push_back(part);
    };
    for (int r = 0; r < con.size(); ++r) {
        const int a = con.a[r], b = con.b[r];
        add(b, a, {r, 0, 1.0});
        add(b, b, {r, 1, 1.0});
        if (is(con.kind[r], ONE_WAY)) continue;
        add(a, a, {r, 0, -1.0});
        add(a, b, {r, 1, -1.0});
    }
    slope_begin.assign(1, 0);
    for (const auto& list : parts) {
        const int entry = static_cast<int>(slope_first.size());
        if (list.empty()) slope_first.push_back(4 * con.size());
        for (const Part& x : list) {
            const int at = x.row + x.end * con.size(), among = x.sign > 0.0 ? at : at + 2 * con.size();
            slope_at.push_back(at);
            slope_sign.push_back(x.sign);
            if (&x == list.data()) slope_first.push_back(among);
            else slope_further.insert(slope_further.end(), {entry, among});
        }
        slope_begin.push_back(static_cast<int>(slope_at.size()));
    }
    for (Drive& f : followers)
        for (int i : f.nodes)
            for (int x : f.factors)
                for (int at : factors[x].of.node) f.entry.push_back(factors[x].kind != OF_STATE && at >= 0 && at < n ? pattern.at(i, at) : -1);
    for (int k = 0; k < felt; ++k) load_place.push_back(follows(k) ? pattern.at(load.node[k % load.size()], load.felt[k]) : -1);
}

std::vector<std::pair<int, int>> Problem::holds() const {
    std::vector<std::pair<int, int>> out;
    std::vector<char> taken(n, 0);
    for (int r = 0; r < con.size(); ++r) {  // what holds the heat of another is tied to that one alone
        const int own = con.a[r], node = con.b[r];
        if (con.kind[r] != POTENTIAL || own >= n || node >= n || capacity[node] >= 0 || capacity[own] < 0 || taken[node]) continue;
        if (pattern.begin[own + 1] - pattern.begin[own] != 2) continue;
        taken[node] = 1;
        out.push_back({node, own});
    }
    return out;
}

Evaluation::Evaluation(const Problem& problem, const double* coefficients) : p(&problem), coef(coefficients) {
    const size_t m = p->con.size(), l = p->load.size();
    u.assign(p->inputs.size(), 0.0);
    ceff.assign(coef, coef + p->nc);
    ceff.push_back(0.0);
    ceff.push_back(std::numeric_limits<double>::infinity());
    ceff.push_back(1.0);
    t.assign(p->nodes(), 0.0);
    q.assign(2 * m, 0.0);
    phi.assign(m, 0.0);
    qab.assign(4 * m + 1, 0.0);
    qa = qab.data();
    qb = qa + m;
    power.assign(l, 0.0);
    slope.assign(2 * l, 0.0);
    on.assign(p->switches(), 0);
    std::copy(p->machines.begin(), p->machines.end(), on.begin() + p->control.size());
    factor.assign(p->factors.size(), 1.0);
    bend.assign(p->factors.size(), 0.0);
    for (const Drive& x : p->followers) pull.emplace_back(x.nodes.size(), 0.0);
    piece.assign(p->con.place.back(), 0);
    f.assign(p->nodes(), 0.0);
    renew();
}

void Evaluation::renew() {
    for (int j = 0; j < p->nc; ++j)
        if (p->coef_input[j] < 0) ceff[j] = coef[j];
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
        case 1: {
            const Conductors& c = p->con;
            const int r = e.row;
            return conductor<true>(c.kind[r], t[c.a[r]], t[c.b[r]], ceff[c.c0[r]], ceff[c.c1[r]], p->tables.data() + c.table[r]).q1;
        }
        case 4: return qa[e.row];
        default: return qb[e.row];
    }
}

Controlled<double> Evaluation::load(int r) const {
    return load<double>(r, [&](int i) { return t[i]; }, [&](int k) { return ceff[k]; });
}

double Evaluation::put_load(int r) {
    const Controlled<double> y = load(r);
    slope[r] = y.pt;
    slope[p->load.size() + r] = y.ps;
    return power[r] = y.p;
}

double Evaluation::load_slope(const Entry& e) const {
    if (e.what == 4 || e.what == 5) return slope[e.row + (e.what - 4) * p->load.size()];
    if (p->load.kind[e.row] == SIGNAL && p->load.control[e.row] < 0) return 1.0;
    const Controlled<double> y = load(e.row);
    return e.what < 4 ? y.pc[e.what] : y.sc[e.what - 6];
}

void Scatter::build(const Problem& p, const CoefJacobian& d) {
    derivatives = &d;
    plain_.clear();
    parts_.clear();
    other.clear();
    exponents = false;
    auto put = [&](std::vector<Part>& to, int from, int node, int coef, double sign) {
        if (node >= p.n) return;
        for (int k = d.indptr[coef]; k < d.indptr[coef + 1]; ++k) to.push_back({node * d.np + d.indices[k], from, sign * d.data[k]});
    };
    for (const Entry& e : con) {
        const bool plain = e.what == 0 && p.coef_input[e.coef] < 0;
        const int from = plain ? e.row : static_cast<int>(other.size());
        put(plain ? plain_ : parts_, from, p.con.b[e.row], e.coef, 1.0);
        if (!is(p.con.kind[e.row], ONE_WAY)) put(plain ? plain_ : parts_, from, p.con.a[e.row], e.coef, -1.0);
        if (!plain) other.push_back(e);
        exponents = exponents || e.what == 1;
    }
    int entry = static_cast<int>(other.size());
    for (const Entry& e : load) put(parts_, entry++, p.load.node[e.row], e.coef, 1.0);
    value.assign(entry, 0.0);
}

void Evaluation::add_parameters(Scatter& s, double* fp, double scale) const {
    double* v = s.value.data();
    auto times = [&](const Entry& e) { return p->coef_input[e.coef] < 0 ? scale : scale * u[p->coef_input[e.coef]]; };
    s.add_plain(phi.data(), scale, fp);
    for (const Entry& e : s.other) *v++ = con_slope(e) * times(e);
    for (const Entry& e : s.load) *v++ = load_slope(e) * times(e);
    s.add(fp);
    if (!p->followers.empty() && s.derivatives->np > 0) follow_parameters(*s.derivatives, fp, scale);
}

void Problem::pushes_of(const Entry& e, const double* coef, std::vector<Push>& out) const {
    const int first = coef_input[e.coef] * n, a = con.a[e.row], b = con.b[e.row], at = e.what == 4 ? e.row : e.row + con.size();
    if (b < n) out.push_back({first + b, at, coef[e.coef]});
    if (!is(con.kind[e.row], ONE_WAY) && a < n) out.push_back({first + a, at, -coef[e.coef]});
}

void Evaluation::input_slopes(const std::vector<Push>& pushes, const std::vector<Entry>& con, const std::vector<Entry>& load, double* fu) const {
    const int n = p->n;
    std::fill(fu, fu + p->inputs.size() * n, 0.0);
    for (const Push& x : pushes) fu[x.place] += x.factor * qa[x.at];
    for (const Entry& e : con) {
        double* to = fu + static_cast<size_t>(p->coef_input[e.coef]) * n;
        const double v = con_slope(e) * coef[e.coef];
        if (p->con.b[e.row] < n) to[p->con.b[e.row]] += v;
        if (!is(p->con.kind[e.row], ONE_WAY) && p->con.a[e.row] < n) to[p->con.a[e.row]] -= v;
    }
    for (const Entry& e : load) fu[static_cast<size_t>(p->coef_input[e.coef]) * n + p->load.node[e.row]] += load_slope(e) * coef[e.coef];
    if (!p->followers.empty()) follow_inputs(fu);
}

}  // namespace thermid
