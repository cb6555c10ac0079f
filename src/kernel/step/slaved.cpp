// Nodes without delay: solved from f = 0, and eliminated from derivatives.
#include <algorithm>
#include <cmath>

#include "step/slaved.hpp"

namespace thermid {

namespace {
constexpr int SMALL = 16;  // so many nodes are eliminated as a full block
}

Slaved::Slaved(Setup& setup, Step& step)
    : setup_(setup), step_(step), p_(setup.p), d_(setup.d), n_(setup.n), np_(setup.np), second_(p_), xa_(n_, 0.0), row_(p_.pattern.size(), 0.0),
      dJ_(p_.pattern.size(), 0.0) {
    for (auto* v : {&fp_, &G_}) v->assign(static_cast<size_t>(n_) * np_, 0.0);
    massless.nodes = p_.massless;
    find_neighbours();
    index(massless);
}

void Slaved::find_neighbours() {
    massless_begin_.assign(1, 0);
    for (int i = 0; i < n_; ++i) {
        for (int k = p_.pattern.begin[i]; setup_.cap[i] > 0.0 && k < p_.pattern.begin[i + 1]; ++k) {
            const int m = p_.pattern.col[k], back = setup_.cap[m] == 0.0 ? p_.pattern.at(m, i) : p_.pattern.size();
            if (back < p_.pattern.size()) massless_at_.insert(massless_at_.end(), {k, back, p_.pattern.diag[m]});
        }
        massless_begin_.push_back(static_cast<int>(massless_at_.size()));
    }
}

void Slaved::index(SlavedGroup& s) {
    s.is.assign(p_.nodes(), 0);
    for (int i : s.nodes) s.is[i] = 1;
    s.con_rows.clear();
    s.load_rows.clear();
    s.parameters.con.clear();
    s.parameters.load.clear();
    for (int r = 0; r < p_.con.size(); ++r)
        if (s.is[p_.con.a[r]] || s.is[p_.con.b[r]]) s.con_rows.push_back(r);
    for (int r = 0; r < p_.load.size(); ++r)
        if (s.is[p_.load.node[r]]) s.load_rows.push_back(r);
    for (const Entry& e : setup_.parameters.con)
        if (s.is[p_.con.a[e.row]] || s.is[p_.con.b[e.row]]) s.parameters.con.push_back(e);
    for (const Entry& e : setup_.parameters.load)
        if (s.is[p_.load.node[e.row]]) s.parameters.load.push_back(e);
    s.parameters.build(p_, d_);
    block_of(s);
}

// The pattern of their block, and the order in which it is eliminated: heat that lumps store is a block of its own as large as the network.
void Slaved::block_of(SlavedGroup& s) const {
    const int m = static_cast<int>(s.nodes.size());
    s.place.assign(p_.nodes(), -1);
    for (int k = 0; k < m; ++k) s.place[s.nodes[k]] = k;
    std::vector<std::vector<int>> columns(m);
    for (int x = 0; x < m; ++x)
        for (int k = p_.pattern.begin[s.nodes[x]]; k < p_.pattern.begin[s.nodes[x] + 1]; ++k)
            if (const int y = s.place[p_.pattern.col[k]]; y >= 0) columns[x].push_back(y);
    s.pattern.build(m, std::move(columns));
    s.elimination = Elimination();
    if (m > SMALL) s.elimination.build(s.pattern);
    else s.elimination.full = true;
    s.from.resize(s.pattern.size());
    for (int x = 0; x < m; ++x)
        for (int k = s.pattern.begin[x]; k < s.pattern.begin[x + 1]; ++k) s.from[k] = p_.pattern.at(s.nodes[x], s.nodes[s.pattern.col[k]]);
    s.lu.resize(s.pattern, s.elimination);
    s.factored = false;
}

// How fast a node follows the others for its capacity, its massless neighbours following it [W/K].
double Slaved::own_rate(int i) const {
    double j = step_.J0[p_.pattern.diag[i]];
    for (int k = massless_begin_[i]; k < massless_begin_[i + 1]; k += 3) {
        const double pivot = step_.J0[massless_at_[k + 2]];
        if (pivot != 0.0) j -= step_.J0[massless_at_[k]] * step_.J0[massless_at_[k + 1]] / pivot;
    }
    return j;
}

// Massless nodes, and those whose time constant is below a small part of the step, as far as the others determine them: as a group, too, they
// must settle in a small part of the step. Heavy nodes tied closely together do not, however fast each of them follows its neighbour; the
// heaviest are taken out of the group until it does.
void Slaved::make(SlavedGroup& s, double small) {
    std::vector<int>& group = group_;
    group.clear();
    s.tied.clear();
    for (int i = 0; i < n_; ++i)
        if (setup_.cap[i] == 0.0 || setup_.cap[i] < -small * step_.h * own_rate(i)) group.push_back(i);
    while (group.size() > massless.nodes.size()) {
        const size_t m = group.size();
        if (trial_.nodes != group) {
            trial_.nodes = group;
            block_of(trial_);
        }
        for (int k = 0; k < trial_.pattern.size(); ++k) trial_.lu.data()[k] = step_.J0[trial_.from[k]];
        for (size_t x = 0; x < m; ++x) xa_[x] = setup_.cap[group[x]];
        const bool determined = trial_.lu.factor() < 0;
        if (determined) trial_.lu.solve(xa_.data());
        auto late = [&](size_t x) { return setup_.cap[group[x]] > 0.0 && !(determined && std::fabs(xa_[x]) <= 10.0 * small * step_.h); };
        double heaviest = 0.0;
        for (size_t x = 0; x < m; ++x)
            if (late(x)) heaviest = std::max(heaviest, setup_.cap[group[x]]);
        if (heaviest == 0.0) break;
        size_t kept = 0;
        for (size_t x = 0; x < m; ++x) {
            const int i = group[x];
            if (late(x) && setup_.cap[i] >= 0.1 * heaviest) s.tied.push_back(i);
            else group[kept++] = i;
        }
        group.resize(kept);
    }
    if (s.is.size() == static_cast<size_t>(p_.nodes()) && s.nodes == group) return;
    s.nodes = group;
    index(s);
}

void Slaved::factor(SlavedGroup& s, const double* j) {
    const int m = static_cast<int>(s.nodes.size());
    if (m == 0) return;
    for (int k = 0; k < s.pattern.size(); ++k) s.lu.data()[k] = j[s.from[k]];
    const int bad = s.lu.factor();
    s.factored = true;
    if (bad >= 0) throw Failure{SINGULAR_NODE, s.nodes[bad]};
}

// Rows that touch slaved nodes only; e.f is right for those nodes alone.
void Slaved::rows(const SlavedGroup& s, Evaluation& e) const {
    for (int i : s.nodes) e.f[i] = 0.0;
    if (!p_.followers.empty()) e.follow();
    const Conductors& c = p_.con;
    for (int r : s.con_rows) {
        const auto x = conductor(c.kind[r], e.t[c.a[r]], e.t[c.b[r]], e.ceff[c.c0[r]], e.ceff[c.c1[r]],
                                         p_.tables.data() + c.table[r]);
        e.q[r] = x.q;
        e.phi[r] = x.phi;
        e.qa[r] = x.qa;
        e.qb[r] = x.qb;
        if (s.is[c.b[r]]) e.f[c.b[r]] += x.q;
        if (s.is[c.a[r]] && !is(c.kind[r], ONE_WAY)) e.f[c.a[r]] -= x.q;
    }
    for (int r : s.load_rows) e.f[p_.load.node[r]] += e.put_load(r);
    if (!p_.followers.empty()) e.find_pull();
}

// Rows of the Jacobian that belong to slaved nodes, as values of the pattern.
void Slaved::jacobian(const SlavedGroup& s, const Evaluation& e, double* j) const {
    const Pattern& at = p_.pattern;
    if (!p_.followers.empty()) {
        std::fill(j, j + at.size(), 0.0);
        e.follow_slopes(j);
    }
    for (int i : s.nodes)
        for (int k = at.begin[i]; k < at.begin[i + 1]; ++k) {
            if (p_.followers.empty()) j[k] = 0.0;
            for (int x = p_.slope_begin[k]; x < p_.slope_begin[k + 1]; ++x) j[k] += p_.slope_sign[x] * e.qab[p_.slope_at[x]];
        }
    for (int r : s.load_rows)
        for (int k : {r, p_.load.size() + r})
            if (p_.load_place[k] >= 0) j[p_.load_place[k]] += e.slope[k];
}

// Newton on f = heat of the slaved nodes (none: 0), the others held. Starts with the factors at hand.
void Slaved::solve(SlavedGroup& s, Evaluation& e, const double* heat) {
    const int m = static_cast<int>(s.nodes.size());
    auto refresh = [&] {
        jacobian(s, e, row_.data());
        factor(s, row_.data());
    };
    double last = std::numeric_limits<double>::infinity(), most = 100.0;  // [K]
    int uncut = 0;
    for (int it = 0; it < 120; ++it) {
        rows(s, e);
        if (!s.factored) refresh();
        for (int k = 0; k < m; ++k) xa_[k] = e.f[s.nodes[k]] - (heat ? heat[k] : 0.0);
        s.lu.solve(xa_.data());
        double size = 0.0, damp = 1.0;
        for (int k = 0; k < m; ++k) size = std::max(size, std::fabs(xa_[k]));
        if (!std::isfinite(size)) throw Failure{NON_FINITE, s.nodes[0]};
        if (size > most) {  // far from the solution T^4 overshoots
            damp = most / size;
            most *= 1.5;
            uncut = 0;
        } else if (++uncut > 8) {
            damp = 0.5;  // full steps may hop to and fro over the corner of a clamped law; half ones end there
        }
        for (int k = 0; k < m; ++k) e.t[s.nodes[k]] -= damp * xa_[k];
        // The next change would be below 1e-12 K, or rounding is all that is left: a node tied closely to one that holds its heat turns a
        // millionth of a kelvin into watts.
        const double rate = it > 0 ? size / last : 1.0;
        if (size * rate < 1e-12 || (size < 1e-9 && rate > 0.5)) return;
        if (size > 1e-2 * last || size > 10.0) s.factored = false;  // factored again where the rows stand next
        last = size;
    }
    throw Failure{NEWTON_FAILED, s.nodes[0]};
}

// Completes a direction whose free components are set: the slaved ones follow so that f stays zero; g is df by inputs.
void Slaved::respond(SlavedGroup& s, const double* j, const double* g, double* dir) {
    const int m = static_cast<int>(s.nodes.size());
    if (m == 0) return;
    for (int i : s.nodes) dir[i] = 0.0;
    for (int k = 0; k < m; ++k) {
        const int i = s.nodes[k];
        double v = g ? g[i] : 0.0;
        for (int c = p_.pattern.begin[i]; c < p_.pattern.begin[i + 1]; ++c) v += j[c] * dir[p_.pattern.col[c]];
        xa_[k] = -v;
    }
    s.lu.solve(xa_.data());
    for (int k = 0; k < m; ++k) dir[s.nodes[k]] = xa_[k];
}

// out = d(dT/dt) along dir (its slaved components are completed); zero for slaved nodes.
void Slaved::rate(SlavedGroup& s, const double* j, const double* g, double* dir, double* out) {
    respond(s, j, g, dir);
    p_.pattern.times(j, dir, out);
    for (int i = 0; i < n_; ++i) out[i] = s.is[i] ? 0.0 : ((g ? g[i] : 0.0) + out[i]) * setup_.inv_cap[i];
}

// d/dp of rate(): dirS holds d(dir)/dp of the free components; the slaved ones are completed.
void Slaved::rate_sensitivity(SlavedGroup& s, Evaluation& e, const double* j, const double* dir_t, const double* dir_u, const double* S,
                                  double* dirS, const double* rate, double* out) {
    const size_t np = np_;
    std::fill(G_.begin(), G_.end(), 0.0);
    const double* dj = second_.add(e, dir_t, dir_u, setup_.parameters, dJ_.data(), G_.data()) ? dJ_.data() : nullptr;
    const int m = static_cast<int>(s.nodes.size());
    for (int i : s.nodes) std::fill(dirS + i * np, dirS + (i + 1) * np, 0.0);
    if (m > 0) {
        for (int k = 0; k < m; ++k) {
            double* to = fp_.data() + k * np;
            const int i = s.nodes[k];
            for (size_t q = 0; q < np; ++q) to[q] = -G_[i * np + q];
            p_.pattern.row_times(j, i, -1.0, dirS, to, np_);
            if (dj) p_.pattern.row_times(dj, i, -1.0, S, to, np_);
        }
        s.lu.solve_many(fp_.data(), np_);
        for (int k = 0; k < m; ++k) std::copy(fp_.data() + k * np, fp_.data() + (k + 1) * np, dirS + s.nodes[k] * np);
    }
    setup_.capacity_term(G_.data(), rate, -1.0);
    for (int i = 0; i < n_; ++i) xa_[i] = s.is[i] ? 0.0 : setup_.inv_cap[i];
    p_.pattern.sum(xa_.data(), G_.data(), j, dirS, dj, S, out, np_);
}

// Sensitivities of the slaved nodes from those of the others and of the heat they take up (nodes, np); rows of e must be current.
void Slaved::sensitivity(SlavedGroup& s, Evaluation& e, double* S, const double* heat) {
    const int m = static_cast<int>(s.nodes.size());
    const size_t np = np_;
    if (m == 0) return;
    jacobian(s, e, row_.data());
    factor(s, row_.data());
    for (int i : s.nodes) std::fill(G_.begin() + i * np, G_.begin() + (i + 1) * np, 0.0);
    e.add_parameters(s.parameters, G_.data(), 1.0);
    for (int k = 0; k < m; ++k) {
        const int i = s.nodes[k];
        double* to = fp_.data() + k * np;
        for (size_t q = 0; q < np; ++q) to[q] = (heat ? heat[k * np + q] : 0.0) - G_[i * np + q];
        for (int c = p_.pattern.begin[i]; c < p_.pattern.begin[i + 1]; ++c)
            if (!s.is[p_.pattern.col[c]]) axpy(to, -row_[c], S + p_.pattern.col[c] * np, np_);
    }
    s.lu.solve_many(fp_.data(), np_);
    for (int k = 0; k < m; ++k) std::copy(fp_.data() + k * np, fp_.data() + (k + 1) * np, S + s.nodes[k] * np);
}

}  // namespace thermid
