// Links, and the rows on special nodes.
#include "large/large.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

// The sweeps are compiled twice where the compiler can choose at run time; everywhere else once, for the portable baseline.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && !defined(__SANITIZE_ADDRESS__)
#define THERMID_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define THERMID_CLONES
#endif
#if defined(__GNUC__)
#define THERMID_RESTRICT __restrict__
#elif defined(_MSC_VER)
#define THERMID_RESTRICT __restrict
#else
#define THERMID_RESTRICT
#endif

namespace thermid {

namespace {

inline double grid_sum(const double* gx, const double* gy, const double* gz, const double* x, int i, int plane, int row) {
    const double c = x[i];
    return gx[i] * (x[i + plane] - c) - gx[i - plane] * (c - x[i - plane]) + gy[i] * (x[i + row] - c) - gy[i - row] * (c - x[i - row]) +
           gz[i] * (x[i + 1] - c) - gz[i - 1] * (c - x[i - 1]);
}

THERMID_CLONES void grid_flow(const double* THERMID_RESTRICT gx, const double* THERMID_RESTRICT gy, const double* THERMID_RESTRICT gz,
                              const double* THERMID_RESTRICT x, double* THERMID_RESTRICT y, int n, int plane, int row) {
    for (int i = 0; i < n; ++i) y[i] = grid_sum(gx, gy, gz, x, i, plane, row);
}

THERMID_CLONES void grid_stage(const double* THERMID_RESTRICT gx, const double* THERMID_RESTRICT gy, const double* THERMID_RESTRICT gz,
                               const double* THERMID_RESTRICT z1, double* THERMID_RESTRICT z2, const double* THERMID_RESTRICT rate,
                               const double* THERMID_RESTRICT ic, int n, int plane, int row, double mu, double nu, double a, double b) {
    for (int i = 0; i < n; ++i)
        z2[i] = mu * z1[i] + nu * z2[i] + a * ic[i] * grid_sum(gx, gy, gz, z1, i, plane, row) + b * rate[i];
}

// Heat of conductors to one boundary at consecutive slots, without slopes.
struct Towards {
    const double *t, *c;
    double tb, f, c1;
    const Table* tables;
    double* q;
};
template <class Law, class C>
THERMID_INLINE void each(const Towards& x, int m, C c1) {
    const double *THERMID_RESTRICT t = x.t, *THERMID_RESTRICT c = x.c;
    double* THERMID_RESTRICT q = x.q;
    for (int k = 0; k < m; ++k) q[k] = Law::heat(t[k], x.tb, x.f * c[k], c1, Tables{x.tables}).q;
}
#define THERMID_HEATS(KIND, LAW, ...) THERMID_CLONES void heats_of_##KIND(const Towards& x, int m) { each<LAW>(x, m, x.c1); }
THERMID_CONDUCTORS(THERMID_HEATS)
#undef THERMID_HEATS
THERMID_CLONES void quarter_heats(const Towards& x, int m) { each<Power>(x, m, Quarter{}); }
#define THERMID_HEATS(KIND, ...) heats_of_##KIND,
constexpr void (*HEATS_OF[])(const Towards&, int) = {THERMID_CONDUCTORS(THERMID_HEATS)};
#undef THERMID_HEATS

// Eight values at a time, so that none waits for the one before it.
THERMID_CLONES void summarise(const double* THERMID_RESTRICT t, const double* THERMID_RESTRICT t1, const double* THERMID_RESTRICT g,
                              const double* THERMID_RESTRICT g1, int n, double a, double b, double c, double d, double* THERMID_RESTRICT sum,
                              double* THERMID_RESTRICT low, double* THERMID_RESTRICT high) {
    for (int i = 0; i + 8 <= n; i += 8)
        for (int k = 0; k < 8; ++k) {
            const double v = a * t[i + k] + b * t1[i + k] + c * g[i + k] + d * g1[i + k];
            sum[k] += v;
            low[k] = v < low[k] ? v : low[k];
            high[k] = v > high[k] ? v : high[k];
        }
}

void require(bool ok, const std::string& message) {
    if (!ok) throw std::invalid_argument(message);
}

}  // namespace

Summary summary(const double* t, const double* t1, const double* g, const double* g1, int n, const Hermite& w) {
    Summary s;
    double sum[8] = {}, low[8], high[8];
    std::fill(low, low + 8, s.low);
    std::fill(high, high + 8, s.high);
    summarise(t, t1, g, g1, n, w.a, w.b, w.c, w.d, sum, low, high);
    for (int i = n - n % 8; i < n; ++i) {
        const double v = w.a * t[i] + w.b * t1[i] + w.c * g[i] + w.d * g1[i];
        sum[0] += v;
        low[0] = std::min(low[0], v);
        high[0] = std::max(high[0], v);
    }
    for (int k = 0; k < 8; ++k) s.sum += sum[k];
    s.low = *std::min_element(low, low + 8);
    s.high = *std::max_element(high, high + 8);
    return s;
}

void Links::flow(const double* x, double* y) const {
    if (plane) {
        const size_t o = plane;
        grid_flow(gx.data() + o, gy.data() + o, gz.data() + o, x, y, n, plane, row);
        return;
    }
    for (int i = 0; i < n; ++i) {
        double s = 0.0;
        for (int k = indptr[i]; k < indptr[i + 1]; ++k) s += value[k] * (x[indices[k]] - x[i]);
        y[i] = s;
    }
}

void Links::stage(const double* z1, double* z2, const double* rate, const double* ic, double mu, double nu, double a, double b) const {
    if (plane) {
        const size_t o = plane;
        grid_stage(gx.data() + o, gy.data() + o, gz.data() + o, z1, z2, rate, ic, n, plane, row, mu, nu, a, b);
        return;
    }
    for (int i = 0; i < n; ++i) {
        double s = 0.0;
        for (int k = indptr[i]; k < indptr[i + 1]; ++k) s += value[k] * (z1[indices[k]] - z1[i]);
        z2[i] = mu * z1[i] + nu * z2[i] + a * ic[i] * s + b * rate[i];
    }
}

void Links::sums(double* d) const {
    for (int i = 0; i < n; ++i) {
        d[i] = 0.0;
        if (plane) {
            const size_t o = static_cast<size_t>(i) + plane;
            d[i] = gx[o] + gx[o - plane] + gy[o] + gy[o - row] + gz[o] + gz[o - 1];
        } else {
            for (int k = indptr[i]; k < indptr[i + 1]; ++k) d[i] += value[k];
        }
    }
}

void LargeProblem::prepare() {
    n = static_cast<int>(capacity.size());
    nb = static_cast<int>(boundary_offset.size());
    const int inputs_n = static_cast<int>(inputs.size()), tables_n = static_cast<int>(tables.size());
    require(n > 0, "a problem needs at least one node");
    require(links.n == n, "links: wrong number of nodes");
    for (double c_i : capacity) require(c_i >= 0.0 && std::isfinite(c_i), "capacity must not be negative");
    require(boundary_input.size() == boundary_offset.size(), "boundaries: input and offset differ in length");
    for (int k : boundary_input) require(k >= -1 && k < inputs_n, "boundaries: no such input");
    require(store.empty() || store.size() == capacity.size(), "stores: one table for each node, or none");
    heavy = capacity;
    for (size_t i = 0; i < store.size(); ++i) {
        if (store[i] < 0) continue;
        require(store[i] < tables_n && capacity[i] > 0.0, "stores: no such table, or a massless node");
        const double steepest = tables[store[i]].steepest();
        require(steepest > 0.0 && std::isfinite(steepest), "stores: temperature must rise with heat");
        stored.push_back(static_cast<int>(i));
        heavy[i] = capacity[i] / steepest;
        knees = knees || !tables[store[i]].bends.empty();
    }
    std::vector<int> slot(n, -1);
    auto place = [&](int i) {
        if (slot[i] < 0) {
            slot[i] = static_cast<int>(special.size());
            special.push_back(i);
        }
        return slot[i];
    };
    a_slot.resize(a.size());
    b_slot.assign(b.size(), -1);
    int done = 0;
    for (RowGroup& g : rows) {
        require(g.begin == done && g.end >= g.begin && g.end <= static_cast<int>(a.size()), "rows: groups must follow one another");
        require(g.kind >= 0 && g.kind < CONDUCTOR_KINDS && !is(g.kind, ONE_WAY), "rows: no such kind");
        require(g.boundary >= -1 && g.boundary < nb && g.input >= -1 && g.input < inputs_n, "rows: no such boundary or input");
        require(!tables_of(g.kind) || (g.table >= 0 && g.table + tables_of(g.kind) <= tables_n), "rows: no such table");
        g.table = std::max(g.table, 0);
        g.bent = has_knee(g.kind) && tables_of(g.kind) == 0;
        for (int k = 0; k < tables_of(g.kind); ++k) g.bent = g.bent || (has_knee(g.kind) && !tables[g.table + k].bends.empty());
        knees = knees || g.bent;
        for (int r = g.begin; r < g.end; ++r) {
            require(a[r] >= 0 && a[r] < n && (g.boundary >= 0 || (b[r] >= 0 && b[r] < n && b[r] != a[r])), "rows: no such node");
            a_slot[r] = place(a[r]);
            if (g.boundary < 0) b_slot[r] = place(b[r]);
        }
        g.consecutive = true;
        for (int r = g.begin; r < g.end; ++r) g.consecutive = g.consecutive && a_slot[r] == a_slot[g.begin] + r - g.begin;
        done = g.end;
    }
    require(done == static_cast<int>(a.size()), "rows: some belong to no group");
    done = 0;
    node_slot.resize(node.size());
    for (LoadGroup& g : loads) {
        require(g.begin == done && g.end >= g.begin && g.end <= static_cast<int>(node.size()), "loads: groups must follow one another");
        require(g.kind >= 0 && g.kind < LOAD_KINDS && g.control >= -1 && g.control < CONTROL_KINDS && g.control != THERMOSTAT, "loads: no such kind");
        require(g.input >= -1 && g.input < inputs_n && g.tag >= 0 && g.tag < tags, "loads: no such input or tag");
        require(!LOAD_LAWS[g.kind].tables || (g.table >= 0 && g.table < tables_n), "loads: no such table");
        g.table = std::max(g.table, 0);
        g.bent = g.control == PROPORTIONAL || (LOAD_LAWS[g.kind].tables && !tables[g.table].bends.empty());
        knees = knees || g.bent;
        for (int r = g.begin; r < g.end; ++r) require(node[r] >= 0 && node[r] < n, "loads: no such node");
        done = g.end;
    }
    require(done == static_cast<int>(node.size()), "loads: some belong to no group");
    for (const bool constant : {false, true}) {  // nodes with constant heat alone come last: stages pass them over
        for (LoadGroup& g : loads) {
            if (g.constant() != constant) continue;
            for (int r = g.begin; r < g.end; ++r) node_slot[r] = place(node[r]);
        }
        if (!constant) moving = static_cast<int>(special.size());
    }
    for (int i : stored) stored_slot.push_back(slot[i]);
    constant_heat.assign(special.size(), 0.0);
    for (LoadGroup& g : loads) {
        if (!g.constant()) continue;
        g.total = 0.0;
        for (int r = g.begin; r < g.end; ++r) {
            constant_heat[node_slot[r]] += c[0][r];
            g.total += c[0][r];
        }
    }
}

RowHeat::RowHeat(const LargeProblem& p)
    : t(p.special.size()), heat(p.special.size()), slope(p.special.size()), pair(p.a.size()), q(p.a.size()), power(p.tags), outflow(p.nb) {}

void RowHeat::evaluate(const LargeProblem& p, const double* u, bool slopes) {
    std::fill(heat.begin(), heat.end(), 0.0);
    if (slopes) std::fill(slope.begin(), slope.end(), 0.0);
    std::fill(power.begin(), power.end(), 0.0);
    std::fill(outflow.begin(), outflow.end(), 0.0);
    for (const RowGroup& g : p.rows) row_group(p, g, u, slopes);
    for (const LoadGroup& g : p.loads) load_group(p, g, u, slopes);
}

void RowHeat::evaluate_moving(const LargeProblem& p, const double* u) {
    std::fill(heat.begin(), heat.begin() + p.moving, 0.0);
    std::fill(power.begin(), power.end(), 0.0);
    std::fill(outflow.begin(), outflow.end(), 0.0);
    for (const RowGroup& g : p.rows) row_group(p, g, u, false);
    for (const LoadGroup& g : p.loads) {
        if (g.constant()) power[g.tag] += g.total;
        else load_group(p, g, u, false);
    }
}

void RowHeat::row_group(const LargeProblem& p, const RowGroup& g, const double* u, bool slopes) {
    const double f = g.input >= 0 ? u[g.input] : 1.0;
    const Table* tables = p.tables.data() + g.table;
    if (g.boundary < 0) {
        for (int r = g.begin; r < g.end; ++r) {
            const int i = p.a_slot[r], j = p.b_slot[r];
            const Conduct<double> c = conductor(g.kind, t[i], t[j], f * p.c0[r], g.c1, tables);
            heat[i] -= c.q;
            heat[j] += c.q;
            if (slopes) pair[r] = 0.5 * (c.qa - c.qb);  // symmetric part: Newton converges a little more slowly, gradients stay conjugate
        }
        return;
    }
    const int input = p.boundary_input[g.boundary], m = g.end - g.begin;
    const double tb = p.boundary_offset[g.boundary] + (input >= 0 ? u[input] : 0.0);
    const int first = m ? p.a_slot[g.begin] : 0;
    double total = 0.0;
    if (!slopes && g.consecutive) {
        const Towards x{t.data() + first, p.c0.data() + g.begin, tb, f, g.c1, tables, q.data() + g.begin};
        (g.kind == POWER && g.c1 == 0.25 ? quarter_heats : HEATS_OF[g.kind])(x, m);
        for (int k = 0; k < m; ++k) {
            heat[first + k] -= q[g.begin + k];
            total += q[g.begin + k];
        }
    } else {
        for (int r = g.begin; r < g.end; ++r) {
            const int i = p.a_slot[r];
            const Conduct<double> c = conductor(g.kind, t[i], tb, f * p.c0[r], g.c1, tables);
            heat[i] -= c.q;
            total += c.q;
            if (slopes) {
                slope[i] += c.qa;
                pair[r] = -c.qb;  // by the boundary's temperature
            }
        }
    }
    outflow[g.boundary] += total;
}

void RowHeat::load_group(const LargeProblem& p, const LoadGroup& g, const double* u, bool slopes) {
    const double f = g.input >= 0 ? u[g.input] : 1.0;
    const Table* tables = p.tables.data() + g.table;
    double total = 0.0;
    for (int r = g.begin; r < g.end; ++r) {
        const int i = p.node_slot[r];
        const double c[4] = {f * p.c[0][r], p.c[1][r], p.c[2][r], p.c[3][r]}, d[3] = {p.d[0][r], p.d[1][r], std::isnan(p.d[2][r]) ? c[0] : p.d[2][r]};
        const auto w = load<double>(g.kind, g.control, t[i], t[i], c, d, Tables{tables}, false, false);
        heat[i] += w.p;
        total += w.p;
        if (slopes) slope[i] -= w.pt + w.ps;
    }
    power[g.tag] += total;
}

}  // namespace thermid
