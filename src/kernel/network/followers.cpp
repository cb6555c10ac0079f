// See followers.hpp.
#include "network/followers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace thermid {

namespace {
void require(bool ok, const char* message) {
    if (!ok) throw std::invalid_argument(message);
}
}  // namespace

void Problem::prepare_controls() {
    const int none = nc, one = nc + 2;
    auto slot = [&](int& c, int missing) {
        require(c >= -1 && c < nc, "controls: no such coefficient");
        if (c < 0) c = missing;
    };
    auto check = [&](Probe& x) {
        slot(x.c0, none);
        for (int k = 0; k < 3; ++k) {
            require(x.node[k] >= -1 && x.node[k] < nodes(), "controls: no such node");
            slot(x.c[k], none);
        }
    };
    const int first = control.size();
    for (Factor& x : factors) {
        require(x.kind >= 0 && x.kind < FACTOR_KINDS, "controls: no such kind");
        check(x.of);
        if (x.kind == CLAMP) {
            require(x.low >= -1 && x.low < nc && x.high >= -1 && x.high < nc, "controls: no such limit");
            if (x.high < 0) x.high = nc + 1;  // infinity; a low of -1 is none
        }
        if (x.kind == LOOKUP) require(x.table >= 0 && x.table < static_cast<int>(tables.size()), "controls: no such table");
        if (x.kind == OF_STATE) {
            require(x.machine >= 0 && x.machine < static_cast<int>(machines.size()) && !x.values.empty(), "controls: no such machine");
            for (int& c : x.values) slot(c, none);
        }
        if ((x.kind == CLAMP && (x.low >= 0 || x.high < nc)) || (x.kind == LOOKUP && !tables[x.table].bends.empty()))
            bent_factors.push_back(static_cast<int>(&x - factors.data()));
    }
    for (Guard& g : guards) {
        require(g.machine >= 0 && g.machine < static_cast<int>(machines.size()) && g.from >= 0 && g.to >= 0 && g.from != g.to, "controls: no such guard");
        check(g.of);
        slot(g.level, none);
        require(g.delay >= -1 && g.delay < nc, "controls: no such delay");
        g.machine += first;
    }
    std::vector<Guard> own;
    for (int j : thermostats) {
        const Probe sensor{none, {control.sensor[j], -1, -1}, {one, none, none}};
        own.push_back({j, 1, 0, sensor, control.c[1][j], 1.0, -1});
        own.push_back({j, 0, 1, sensor, control.c[0][j], -1.0, -1});
    }
    guards.insert(guards.begin(), own.begin(), own.end());
    for (const Sampler& s : samplers)
        require(s.period > 0.0 && is_state(s.node) && s.factor >= 0 && s.factor < static_cast<int>(factors.size()), "controls: no such sampler");
    for (Drive& f : followers) {
        require(f.base >= -1 && f.base < static_cast<int>(inputs.size()), "controls: no such input");
        for (int x : f.factors) require(x >= 0 && x < static_cast<int>(factors.size()), "controls: no such factor");
        for (int j = 0; j < nc; ++j)
            if (coef_input[j] == f.input) f.coefs.push_back(j);
        f.place.assign(n, -1);
        auto moves = [&](int i) {
            if (i >= n || f.place[i] >= 0) return;
            f.place[i] = static_cast<int>(f.nodes.size());
            f.nodes.push_back(i);
        };
        for (const Entry& e : con_entry) {
            if (coef_input[e.coef] != f.input) continue;
            f.con.push_back(e);
            moves(con.b[e.row]);
            if (!is(con.kind[e.row], ONE_WAY)) moves(con.a[e.row]);
        }
        for (const Entry& e : load_entry) {
            if (coef_input[e.coef] != f.input) continue;
            f.load.push_back(e);
            moves(load.node[e.row]);
        }
    }
}

double Evaluation::probe(const Probe& x) const {
    double z = ceff[x.c0];
    for (int k = 0; k < 3; ++k)
        if (x.node[k] >= 0) z += ceff[x.c[k]] * t[x.node[k]];
    return z;
}

double Evaluation::others(const Drive& f, size_t k) const {
    double v = f.base < 0 ? 1.0 : u[f.base];
    for (size_t i = 0; i < f.factors.size(); ++i)
        if (i != k) v *= factor[f.factors[i]];
    return v;
}

void Evaluation::follow() {
    for (size_t k = 0; k < p->factors.size(); ++k) {
        const Factor& x = p->factors[k];
        bend[k] = 0.0;
        if (x.kind == OF_STATE) {
            factor[k] = ceff[x.values[std::min<size_t>(on[p->control.size() + x.machine], x.values.size() - 1)]];
            continue;
        }
        const double z = probe(x.of);
        if (x.kind == LOOKUP) {
            p->tables[x.table].eval(z, factor[k], bend[k]);
            continue;
        }
        const double low = x.low < 0 ? -std::numeric_limits<double>::infinity() : ceff[x.low];
        factor[k] = std::min(std::max(z, low), ceff[x.high]);
        bend[k] = z > low && z < ceff[x.high] ? 1.0 : 0.0;
    }
    for (const Drive& f : p->followers) {
        u[f.input] = others(f, f.factors.size());
        for (int j : f.coefs) ceff[j] = coef[j] * u[f.input];
    }
    for (int k = 0; k < p->nb; ++k) t[p->n + k] = ceff[p->gain[k]] + ceff[p->offset[k]];
}

void Evaluation::find_pull() {
    for (size_t k = 0; k < p->followers.size(); ++k) {
        const Drive& x = p->followers[k];
        double* g = pull[k].data();
        std::fill(pull[k].begin(), pull[k].end(), 0.0);
        for (const Entry& e : x.con) {
            const double v = con_slope(e) * coef[e.coef];
            const int a = p->con.a[e.row], b = p->con.b[e.row];
            if (b < p->n) g[x.place[b]] += v;
            if (a < p->n && !is(p->con.kind[e.row], ONE_WAY)) g[x.place[a]] -= v;
        }
        for (const Entry& e : x.load) g[x.place[p->load.node[e.row]]] += load_slope(e) * coef[e.coef];
    }
}

void Evaluation::follow_slopes(double* v) const {
    each_pull([&](size_t f, size_t k, double by, const Probe& x) {
        const Drive& own = p->followers[f];
        for (size_t i = 0; i < own.nodes.size(); ++i)
            for (int m = 0; m < 3; ++m)
                if (const int at = own.entry[(i * own.factors.size() + k) * 3 + m]; at >= 0) v[at] += pull[f][i] * by * ceff[x.c[m]];
    });
}

// What the coefficients of factors do: of probes, limits and states, and of boundaries that probes read.
void Evaluation::follow_parameters(const CoefJacobian& d, double* fp, double scale) const {
    for (size_t f = 0; f < p->followers.size(); ++f) {
        const Drive& own = p->followers[f];
        for (size_t k = 0; k < own.factors.size(); ++k) {
            const double rest = scale * others(own, k);
            if (rest == 0.0) continue;
            factor_slope(own.factors[k], [&](int c, double by) {
                if (!d.any(c)) return;
                for (size_t i = 0; i < own.nodes.size(); ++i)
                    for (int q = d.indptr[c]; q < d.indptr[c + 1]; ++q)
                        fp[static_cast<size_t>(own.nodes[i]) * d.np + d.indices[q]] += rest * by * pull[f][i] * d.data[q];
            });
        }
    }
}

void Evaluation::follow_inputs(double* fu) const {
    const size_t n = p->n;
    for (size_t f = 0; f < p->followers.size(); ++f) {
        const Drive& own = p->followers[f];
        auto put = [&](int input, double by) {
            if (input < 0 || by == 0.0) return;
            for (size_t i = 0; i < own.nodes.size(); ++i) fu[static_cast<size_t>(input) * n + own.nodes[i]] += by * pull[f][i];
        };
        double whole = 1.0;
        for (int x : own.factors) whole *= factor[x];
        put(own.base, whole);
        for (size_t k = 0; k < own.factors.size(); ++k) {
            const Factor& x = p->factors[own.factors[k]];
            auto of = [&](int c, double by) {
                if (c < p->nc) put(p->coef_input[c], by * coef[c]);
            };
            const double by = others(own, k) * bend[own.factors[k]];
            if (by == 0.0) continue;
            of(x.of.c0, by);
            for (int m = 0; m < 3; ++m) {
                const int at = x.of.node[m];
                if (at < 0) continue;
                of(x.of.c[m], by * t[at]);
                if (at < p->n) continue;
                of(p->gain[at - p->n], by * ceff[x.of.c[m]]);
                of(p->offset[at - p->n], by * ceff[x.of.c[m]]);
            }
        }
    }
}

// Adds w times what heats gain through followers, to first order, when temperatures rise by dir (nodes and boundaries).
void Evaluation::follow_rows(double w, const double* dir, double* conductors, double* loads) const {
    std::vector<double> rise(p->followers.size(), 0.0);
    each_pull([&](size_t f, size_t, double by, const Probe& x) {
        for (int m = 0; m < 3; ++m)
            if (x.node[m] >= 0 && x.node[m] < p->n) rise[f] += by * ceff[x.c[m]] * dir[x.node[m]];
    });
    for (size_t f = 0; f < rise.size(); ++f) {
        if (rise[f] == 0.0) continue;
        for (const Entry& e : p->followers[f].con) conductors[e.row] += w * rise[f] * con_slope(e) * coef[e.coef];
        for (const Entry& e : p->followers[f].load) loads[e.row] += w * rise[f] * load_slope(e) * coef[e.coef];
    }
}

}  // namespace thermid
