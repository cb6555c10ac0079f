// What a run needs before it begins: where parameters and inputs enter, and room for its state and its steps.
#include "step/setup.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include "step/state.hpp"
#include "step/step.hpp"

namespace thermid {

Setup::Setup(const Problem& problem, const double* coefficients, const CoefJacobian& derivatives, const Options& options, LeastSquares* readings)
    : p(problem), coef(coefficients), d(derivatives), o(options), squares(readings), n(p.n), np(d.np), nk(static_cast<int>(p.inputs.size())) {
    if (n > Problem::LARGEST) throw std::invalid_argument("this integrator takes at most " + std::to_string(Problem::LARGEST) + " unknown nodes");
    find_entries();
    find_idle();
    std::copy_if(p.moving.begin(), p.moving.end(), std::back_inserter(acting), [&](int k) { return !idles[k]; });
    parameters.build(p, d);
    faint.assign(np, std::numeric_limits<double>::infinity());
    for (size_t c = 0; np > 0 && c + 1 < d.indptr.size(); ++c)
        for (int k = d.indptr[c]; k < d.indptr[c + 1]; ++k)
            if (coef[c] != 0.0) faint[d.indices[k]] = std::min(faint[d.indices[k]], std::fabs(d.data[k] / coef[c]));
    for (const Edge& e : p.edges)  // what moves an instant is no size
        for (int k = np > 0 ? d.indptr[e.coef] : 0; np > 0 && k < d.indptr[e.coef + 1]; ++k) faint[d.indices[k]] = 0.0;
    for (double& each : faint)
        if (!std::isfinite(each)) each = 0.0;
    for (int k : p.con.kind) curved |= !is(k, STRAIGHT);
    for (int k : p.load.kind) curved |= k != SIGNAL;
    for (int k : p.control.kind) curved |= k != THERMOSTAT;
    curved |= !p.followers.empty();
    constant = !curved && std::all_of(con_u.begin(), con_u.end(), [](const Entry& e) { return e.what >= 4; });
    for (auto* v : {&cap, &inv_cap}) v->assign(n, 0.0);
    cap_at.assign(p.pattern.size(), 0.0);
    take_capacities();
    for (int i = 0; i < n; ++i) {
        all.push_back(i);
        if (p.capacity[i] >= 0 && d.any(p.capacity[i])) sought.push_back(i);
    }
    holds = p.holds();
}

void Setup::find_entries() {
    auto moves = [&](int c) { return p.coef_input[c] >= 0 && p.inputs[p.coef_input[c]].kind != CONSTANT; };
    for (const Entry& e : p.con_entry) {
        if (d.any(e.coef)) parameters.con.push_back(e);
        if (!moves(e.coef)) continue;
        con_u.push_back(e);
        if (e.what >= 4) p.pushes_of(e, coef, pushes);
        else other_u.push_back(e);
    }
    for (const Entry& e : p.load_entry) {
        // Thresholds act through the switching instant only.
        if (e.what > 4 && p.control.kind[p.load.control[e.row]] == THERMOSTAT) continue;
        if (d.any(e.coef)) parameters.load.push_back(e);
        if (moves(e.coef)) load_u.push_back(e);
    }
}

// Where readings are reduced as they come, or inputs follow temperatures, none is taken for idle.
void Setup::find_idle() {
    idles.assign(nk, 0);
    if (np == 0 || squares || !p.followers.empty()) return;
    for (int k = 0; k < nk; ++k) idles[k] = p.inputs[k].sampled();
    for (int c : p.moved) idles[p.coef_input[c]] = idles[p.coef_input[c]] && coef[c] == 0.0;
    std::vector<std::vector<IdleInput>> of(nk);
    auto put = [&](const std::vector<Entry>& entries, bool load) {
        for (const Entry& e : entries) {
            const int k = p.coef_input[e.coef];
            for (int x = d.indptr[e.coef]; k >= 0 && idles[k] && x < d.indptr[e.coef + 1]; ++x) {
                auto& columns = of[k];
                auto at = std::find_if(columns.begin(), columns.end(), [&](const IdleInput& i) { return i.name == d.indices[x]; });
                if (at == columns.end()) at = columns.insert(at, {k, d.indices[x], {}});
                at->parts.push_back({e, load, d.data[x]});
            }
        }
    };
    put(parameters.con, false);
    put(parameters.load, true);
    for (const auto& columns : of) idle.insert(idle.end(), columns.begin(), columns.end());
}

void Setup::take_capacities() {
    for (int i = 0; i < n; ++i) {
        if (p.capacity[i] < 0) continue;
        cap[i] = coef[p.capacity[i]];
        inv_cap[i] = 1.0 / cap[i];
        cap_at[p.pattern.diag[i]] = cap[i];
    }
}

// y[i] += scale * v[i] * dC_i/dp
void Setup::capacity_term(double* y, const double* v, double scale) const {
    for (int i : sought) {
        const int c = p.capacity[i];
        for (int k = d.indptr[c]; k < d.indptr[c + 1]; ++k) y[static_cast<size_t>(i) * np + d.indices[k]] += scale * v[i] * d.data[k];
    }
}

State::State(const Setup& s)
    : T(s.n, 0.0), S(static_cast<size_t>(s.n) * s.np, 0.0), entered(s.p.switches(), 0.0), entered_s(s.p.switches() * static_cast<size_t>(s.np), 0.0),
      drift(s.n, 0.0), E_con(s.p.con.size(), 0.0), E_load(s.p.load.size(), 0.0), sampled(s.p.samplers.size(), 0), switched(s.p.switches(), 0) {}

Step::Step(const Setup& s) : e(s.p, s.coef), factors(s), in(s.nk), hint(s.nk, -1), noise(s.nk) {
    const size_t n = s.n, m = n * s.np;
    for (auto* v : {&T1, &d0, &d1, &dd0, &dd1, &drift_next, &err}) v->assign(n, 0.0);
    for (auto* v : {&S1, &sd0, &sd1, &sdd0, &sdd1}) v->assign(m, 0.0);
    delta.assign(s.p.nodes(), 0.0);  // boundaries stay where they are
    for (auto* v : {&F, &beyond}) v->assign(STAGES * n, 0.0);
    FS.assign(STAGES * m, 0.0);
    for (auto* v : {&J0, &J1}) v->assign(s.p.pattern.size(), 0.0);
    for (auto* v : {&worst, &uder0, &uder1, &u0}) v->assign(s.nk, 0.0);
    fu.assign(s.nk * n, 0.0);
    for (int k = 0; k < s.nk; ++k) {
        if (!s.p.inputs[k].sampled() || s.idles[k]) continue;
        for (auto* v : {&noise[k].b, &noise[k].ab, &noise[k].aab, &noise[k].db, &noise[k].c}) v->assign(n, 0.0);
    }
    idle_b.assign(s.idle.size() * n, 0.0);
    idle_ab = idle_b;
    acc_con.assign(s.p.con.size(), 0.0);
    acc_load.assign(s.p.load.size(), 0.0);
}

}  // namespace thermid
