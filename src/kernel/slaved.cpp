// Nodes without delay: solved from f = 0, and eliminated from derivatives.
#include <algorithm>
#include <cmath>

#include "integrator.hpp"

namespace thermid {

void Integrator::index_slaved(Slaved& s) {
    s.is.assign(p_.nodes(), 0);
    for (int i : s.nodes) s.is[i] = 1;
    s.con_rows.clear();
    s.load_rows.clear();
    s.con_p.clear();
    s.load_p.clear();
    for (int r = 0; r < p_.con.size(); ++r)
        if (s.is[p_.con.a[r]] || s.is[p_.con.b[r]]) s.con_rows.push_back(r);
    for (int r = 0; r < p_.load.size(); ++r)
        if (s.is[p_.load.node[r]]) s.load_rows.push_back(r);
    for (const Entry& e : con_p_)
        if (s.is[p_.con.a[e.row]] || s.is[p_.con.b[e.row]]) s.con_p.push_back(e);
    for (const Entry& e : load_p_)
        if (s.is[p_.load.node[e.row]]) s.load_p.push_back(e);
    s.lu.resize(static_cast<int>(s.nodes.size()));
    s.factored = false;
}

// Massless nodes, and those whose time constant is below a small part of the step.
void Integrator::make_slaved(Slaved& s, double small) {
    bool same = s.is.size() == static_cast<size_t>(p_.nodes());
    auto member = [&](int i) { return cap_[i] == 0.0 || cap_[i] < -small * h_ * J0_[i * n_ + i]; };
    for (int i = 0; same && i < n_; ++i) same = member(i) == static_cast<bool>(s.is[i]);
    if (same) return;
    s.nodes.clear();
    for (int i = 0; i < n_; ++i)
        if (member(i)) s.nodes.push_back(i);
    index_slaved(s);
}

void Integrator::factor_slaved(Slaved& s, const double* j) {
    const int m = static_cast<int>(s.nodes.size());
    for (int x = 0; x < m; ++x)
        for (int y = 0; y < m; ++y) s.lu.data()[x * m + y] = j[s.nodes[x] * n_ + s.nodes[y]];
    const int bad = s.lu.factor();
    s.factored = true;
    if (bad >= 0) throw Failure{SINGULAR_NODE, s.nodes[bad]};
}

// Whether the others determine the slaved nodes: their block of the Jacobian is regular.
bool Integrator::settles(Slaved& s) {
    const int m = static_cast<int>(s.nodes.size());
    if (m == static_cast<int>(massless_.nodes.size())) return true;
    for (int x = 0; x < m; ++x)
        for (int y = 0; y < m; ++y) s.lu.data()[x * m + y] = J0_[static_cast<size_t>(s.nodes[x]) * n_ + s.nodes[y]];
    s.factored = false;
    if (s.lu.factor() >= 0) return false;
    double low = std::numeric_limits<double>::infinity(), high = 0.0;
    for (int x = 0; x < m; ++x) {
        const double own = std::fabs(J0_[static_cast<size_t>(s.nodes[x]) * n_ + s.nodes[x]]), pivot = std::fabs(s.lu.data()[x * m + x]) / own;
        low = std::min(low, pivot);
        high = std::max(high, pivot);
    }
    return low > 1e-6 * high;
}

// Rows that touch slaved nodes only; e.f is right for those nodes alone.
void Integrator::slaved_rows(const Slaved& s, Evaluation& e) const {
    for (int i : s.nodes) e.f[i] = 0.0;
    const Conductors& c = p_.con;
    for (int r : s.con_rows) {
        const auto x = conductor<double>(c.kind[r], e.t[c.a[r]], e.t[c.b[r]], e.ceff[c.c0[r]], e.ceff[c.c1[r]],
                                         c.table[r] >= 0 ? &p_.tables[c.table[r]] : nullptr);
        e.q[r] = x.q;
        e.phi[r] = x.phi;
        e.qa[r] = x.qa;
        e.qb[r] = x.qb;
        if (s.is[c.b[r]]) e.f[c.b[r]] += x.q;
        if (s.is[c.a[r]] && c.kind[r] != FLOW) e.f[c.a[r]] -= x.q;
    }
    const Loads& l = p_.load;
    for (int r : s.load_rows) {
        const double cs[4] = {e.ceff[l.c[0][r]], e.ceff[l.c[1][r]], e.ceff[l.c[2][r]], e.ceff[l.c[3][r]]};
        const auto x = load<double>(l.kind[r], e.t[l.sensor[r]], cs, l.table[r] >= 0 ? &p_.tables[l.table[r]] : nullptr, e.on[r]);
        e.power[r] = x.p;
        e.slope[r] = x.pt;
        e.f[l.node[r]] += x.p;
    }
}

// Rows of the Jacobian that belong to slaved nodes, into a full (n, n) array.
void Integrator::slaved_jacobian(const Slaved& s, const Evaluation& e, double* j) const {
    for (int i : s.nodes) std::fill(j + i * n_, j + (i + 1) * n_, 0.0);
    const Conductors& c = p_.con;
    for (int r : s.con_rows) {
        const int a = c.a[r], b = c.b[r];
        if (s.is[a] && c.kind[r] != FLOW) {
            j[a * n_ + a] -= e.qa[r];
            if (b < n_) j[a * n_ + b] -= e.qb[r];
        }
        if (s.is[b]) {
            if (a < n_) j[b * n_ + a] += e.qa[r];
            j[b * n_ + b] += e.qb[r];
        }
    }
    for (int r : s.load_rows)
        if (p_.load.sensor[r] < n_) j[p_.load.node[r] * n_ + p_.load.sensor[r]] += e.slope[r];
}

// Newton on f = heat of the slaved nodes (none: 0), the others held. Starts with the factors at hand.
void Integrator::solve_slaved(Slaved& s, Evaluation& e, const double* heat) {
    const int m = static_cast<int>(s.nodes.size());
    auto refresh = [&] {
        slaved_jacobian(s, e, row_.data());
        factor_slaved(s, row_.data());
    };
    double last = std::numeric_limits<double>::infinity();
    for (int it = 0; it < 120; ++it) {
        slaved_rows(s, e);
        if (!s.factored) refresh();
        for (int k = 0; k < m; ++k) xa_[k] = e.f[s.nodes[k]] - (heat ? heat[k] : 0.0);
        s.lu.solve(xa_.data());
        // Full steps may hop to and fro over the corner of a clamped law; half ones end there.
        double size = 0.0, damp = it > 8 ? 0.5 : 1.0;
        for (int k = 0; k < m; ++k) size = std::max(size, std::fabs(xa_[k]));
        if (!std::isfinite(size)) throw Failure{NON_FINITE, s.nodes[0]};
        if (size > 100.0) damp *= 100.0 / size;  // far from the solution T^4 overshoots
        for (int k = 0; k < m; ++k) e.t[s.nodes[k]] -= damp * xa_[k];
        // The next change would be below 1e-9 K.
        if (size < 1e-9 || (size < 1e-6 && size < 1e-3 * last)) return;
        if (size > 1e-2 * last || size > 10.0) s.factored = false;  // factored again where the rows stand next
        last = size;
    }
    throw Failure{NEWTON_FAILED, s.nodes[0]};
}

// Completes a direction whose free components are set: the slaved ones follow so that f stays zero; g is df by inputs.
void Integrator::respond(Slaved& s, const double* j, const double* g, double* dir) {
    const int m = static_cast<int>(s.nodes.size());
    if (m == 0) return;
    for (int i : s.nodes) dir[i] = 0.0;
    for (int k = 0; k < m; ++k) {
        const int i = s.nodes[k];
        double v = g ? g[i] : 0.0;
        for (int c = 0; c < n_; ++c) v += j[i * n_ + c] * dir[c];
        xa_[k] = -v;
    }
    s.lu.solve(xa_.data());
    for (int k = 0; k < m; ++k) dir[s.nodes[k]] = xa_[k];
}

// out = d(dT/dt) along dir (its slaved components are completed); zero for slaved nodes.
void Integrator::rate(Slaved& s, const double* j, const double* g, double* dir, double* out) {
    respond(s, j, g, dir);
    for (int i = 0; i < n_; ++i) {
        if (s.is[i]) { out[i] = 0.0; continue; }
        double v = g ? g[i] : 0.0;
        const double* row = j + i * n_;
        for (int c = 0; c < n_; ++c) v += row[c] * dir[c];
        out[i] = v / cap_[i];
    }
}

// y = j x for (n, np)
void Integrator::times(const double* j, const double* x, double* y) const {
    for (int i = 0; i < n_; ++i) {
        double* to = y + static_cast<size_t>(i) * np_;
        std::fill(to, to + np_, 0.0);
        for (int c = 0; c < n_; ++c)
            if (const double v = j[i * n_ + c]; v != 0.0) axpy(to, v, x + static_cast<size_t>(c) * np_, np_);
    }
}

// y[i] += scale * v[i] * dC_i/dp
void Integrator::capacity_term(double* y, const double* v, double scale) const {
    for (int i = 0; i < n_; ++i) {
        const int c = p_.capacity[i];
        if (c < 0 || !d_.any(c)) continue;
        for (int k = d_.indptr[c]; k < d_.indptr[c + 1]; ++k) y[static_cast<size_t>(i) * np_ + d_.indices[k]] += scale * v[i] * d_.data[k];
    }
}

// d/dp of rate(): dirS holds d(dir)/dp of the free components; the slaved ones are completed.
void Integrator::rate_sensitivity(Slaved& s, Evaluation& e, const double* j, const double* dir_t, const double* dir_u, const double* S,
                                  double* dirS, const double* rate, double* out) {
    const size_t np = np_;
    std::fill(G_.begin(), G_.end(), 0.0);
    second_.add(e, dir_t, dir_u, d_, con_p_, load_p_, S, G_.data());
    const int m = static_cast<int>(s.nodes.size());
    for (int i : s.nodes) std::fill(dirS + i * np, dirS + (i + 1) * np, 0.0);
    if (m > 0) {
        for (int k = 0; k < m; ++k) {
            double* to = fp_.data() + k * np;
            const int i = s.nodes[k];
            for (size_t q = 0; q < np; ++q) to[q] = -G_[i * np + q];
            for (int c = 0; c < n_; ++c)
                if (const double v = j[i * n_ + c]; v != 0.0) axpy(to, -v, dirS + c * np, np_);
        }
        s.lu.solve_many(fp_.data(), np_);
        for (int k = 0; k < m; ++k) std::copy(fp_.data() + k * np, fp_.data() + (k + 1) * np, dirS + s.nodes[k] * np);
    }
    times(j, dirS, out);
    for (size_t x = 0; x < G_.size(); ++x) out[x] += G_[x];
    capacity_term(out, rate, -1.0);
    for (int i = 0; i < n_; ++i) {
        const double c = s.is[i] ? 0.0 : 1.0 / cap_[i];
        for (size_t q = 0; q < np; ++q) out[i * np + q] *= c;
    }
}

// Sensitivities of the slaved nodes from those of the others and of the heat they take up (nodes, np); rows of e must be current.
void Integrator::slaved_sensitivity(Slaved& s, Evaluation& e, double* S, const double* heat) {
    const int m = static_cast<int>(s.nodes.size());
    const size_t np = np_;
    if (m == 0) return;
    slaved_jacobian(s, e, row_.data());
    factor_slaved(s, row_.data());
    for (int i : s.nodes) std::fill(G_.begin() + i * np, G_.begin() + (i + 1) * np, 0.0);
    e.add_parameters(d_, s.con_p, s.load_p, G_.data(), 1.0);
    for (int k = 0; k < m; ++k) {
        const int i = s.nodes[k];
        double* to = fp_.data() + k * np;
        for (size_t q = 0; q < np; ++q) to[q] = (heat ? heat[k * np + q] : 0.0) - G_[i * np + q];
        for (int c = 0; c < n_; ++c)
            if (const double v = row_[i * n_ + c]; v != 0.0 && !s.is[c]) axpy(to, -v, S + c * np, np_);
    }
    s.lu.solve_many(fp_.data(), np_);
    for (int k = 0; k < m; ++k) std::copy(fp_.data() + k * np, fp_.data() + (k + 1) * np, S + s.nodes[k] * np);
}

}  // namespace thermid
