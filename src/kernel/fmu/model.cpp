// See model.hpp.
#include "fmu/model.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "network/followers.hpp"

namespace thermid {

namespace {
constexpr double NEVER = std::numeric_limits<double>::infinity();
constexpr double AHEAD = 100.0;  // how far steps may reach beyond the host's, in parts of its own; they rarely do
constexpr double PASSED = 1e-9;  // how close to its level a guard counts as passed: what the host's root search may leave [K]
constexpr double CLOSE = 1e-12;  // of massless nodes, as a share of their temperature
constexpr int MOST = 100;        // iterations of Newton's method
}  // namespace

std::vector<char> Snapshot::bytes() const {
    std::vector<double> flat{time};
    for (const auto* v : {&names, &t, &entered, &sampled, &segment, &on}) {
        flat.push_back(static_cast<double>(v->size()));
        flat.insert(flat.end(), v->begin(), v->end());
    }
    std::vector<char> out(flat.size() * sizeof(double));
    std::memcpy(out.data(), flat.data(), out.size());
    return out;
}

Snapshot Snapshot::of(const char* data, size_t size, const Snapshot& like) {
    Snapshot out = like;
    std::vector<double> flat(size / sizeof(double));
    std::memcpy(flat.data(), data, flat.size() * sizeof(double));
    size_t at = 0;
    const auto take = [&] {
        if (at >= flat.size()) throw std::invalid_argument("the serialised state is not one of this model");
        return flat[at++];
    };
    out.time = take();
    for (auto* v : {&out.names, &out.t, &out.entered, &out.sampled, &out.segment, &out.on}) {
        if (take() != static_cast<double>(v->size())) throw std::invalid_argument("the serialised state is not one of this model");
        for (double& x : *v) x = take();
    }
    return out;
}

FmuModel::FmuModel(std::shared_ptr<const Image> image)
    : image_(std::move(image)), p_(image_->problem), coef_(p_.nc, 0.0), dcoef_(p_.nc, 0.0), e_(p_, (image_->program.values(image_->start.data(), value_, coef_), coef_.data())) {
    for (int i = 0; i < p_.n; ++i)
        if (p_.capacity[i] >= 0) states_.push_back(i);
    for (size_t g = 0; g < p_.guards.size(); ++g)
        if (p_.guards[g].delay < 0) watched_.push_back(static_cast<int>(g));
    const size_t m = p_.massless.size();
    for (int i : p_.massless)
        for (int j : p_.massless) block_.push_back(p_.pattern.at(i, j));
    lu_.resize(static_cast<int>(m));
    step_.assign(m, 0.0);
    jacobian_.assign(p_.pattern.size(), 0.0);
    holds_ = p_.holds();
    options_.energy = false;
    options_.input_atol = 1e-6;
    if (!p_.guards.empty()) {  // tighter than a run of its own: switchings then fall within 1e-5 K of where they belong
        options_.rtol = 2e-9;
        options_.atol = 2e-8;
    }
    reset();
}

void FmuModel::reset() {
    now_.time = 0.0;
    now_.names = image_->start;
    now_.t = image_->initial;
    now_.entered.assign(p_.switches(), 0.0);
    now_.on.assign(p_.switches(), 0.0);
    now_.sampled.assign(p_.samplers.size(), 0.0);
    now_.segment.assign(p_.inputs.size(), -1.0);
    begin(0.0);
}

void FmuModel::restore(const Snapshot& kept) {
    now_ = kept;
    starting_ = false;
    coefficients_ = restart_ = true;
    fresh_ = false;
}

void FmuModel::tolerance(double relative) {
    if (!(relative > 0.0)) return;  // its own where the host's are wider
    options_.rtol = std::min(options_.rtol, relative);
    options_.atol = std::min(options_.atol, 100.0 * relative);
}

std::string FmuModel::where(int node) const { return node >= 0 && node < p_.nodes() ? " at '" + image_->nodes[node] + "'" : ""; }

void FmuModel::refuse(const Failure& f, double time) const {
    static const char* WORDS[] = {"",
                                  "too many steps",
                                  "the step became too small; a law may jump there",
                                  "a step could not be solved",
                                  "a temperature or heat flow is not a number; a table that is refused outside its points may have been left",
                                  "the temperature runs away",
                                  "a massless node has no conductance to anything, so its temperature is undefined",
                                  "a temperature must not lie below 0 K, a capacitance must lie above zero and every number must be finite",
                                  "a thermostat or controller switches without end; widen its hysteresis"};
    throw std::runtime_error(std::string(WORDS[f.status]) + where(f.node) + ", at " + std::to_string(time) + " s");
}

void FmuModel::set_time(double t) {
    if (t != now_.time) restart_ = true;
    now_.time = t;
    fresh_ = false;
}

void FmuModel::set(const Variable& x, double value) {
    if (!std::isfinite(value)) throw std::invalid_argument("a value that is set must be finite");
    if (x.kind == VALUE) {
        if (now_.names[x.place] == value) return;
        now_.names[x.place] = value;
        coefficients_ = changed_ = true;
    } else if (x.kind == TEMPERATURE && x.place < p_.n && p_.capacity[x.place] >= 0) {
        now_.t[x.place] = value;
        restart_ = true;
    } else {
        throw std::invalid_argument("a variable that follows from others cannot be set");
    }
    fresh_ = false;
}

void FmuModel::set_states(const double* x) {
    for (size_t k = 0; k < states_.size(); ++k) now_.t[states_[k]] = x[k];
    fresh_ = false;
    restart_ = true;
}

void FmuModel::get_states(double* x) const {
    for (size_t k = 0; k < states_.size(); ++k) x[k] = now_.t[states_[k]];
}

void FmuModel::renew() {
    image_->program.values(now_.names.data(), value_, coef_);
    for (double c : coef_)
        if (!std::isfinite(c)) refuse({BAD_INPUT, -1}, now_.time);
    for (int i : states_)
        if (!(coef_[p_.capacity[i]] > 0.0)) refuse({BAD_INPUT, i}, now_.time);
    e_.renew();
    coefficients_ = false;
}

// Sampled inputs keep to the piece that the latest event left them on, so that nothing jumps between events.
void FmuModel::courses() {
    for (size_t k = 0; k < p_.inputs.size(); ++k) {
        const Input& x = p_.inputs[k];
        if (x.kind == FOLLOWED) continue;
        if (!x.sampled()) {
            e_.u[k] = x.at(now_.time);
            continue;
        }
        const int i = static_cast<int>(now_.segment[k]);
        e_.u[k] = i < 0 ? x.mean + x.seg[0].u : x.mean + x.seg[i].u + x.seg[i].s * (now_.time - x.seg[i].t);
    }
    e_.set_inputs();
}

void FmuModel::factor() {
    const size_t m = p_.massless.size();
    e_.slopes(jacobian_.data());
    for (size_t k = 0; k < m * m; ++k) lu_.data()[k] = block_[k] < p_.pattern.size() ? jacobian_[block_[k]] : 0.0;
    const int bad = lu_.factor();
    if (bad >= 0) refuse({SINGULAR_NODE, p_.massless[bad]}, now_.time);
}

void FmuModel::settle() {
    const size_t m = p_.massless.size();
    for (int k = 0;; ++k) {
        e_.rows();
        if (m == 0) break;
        for (size_t i = 0; i < m; ++i) step_[i] = e_.f[p_.massless[i]];
        factor();
        lu_.solve(step_.data());
        double worst = 0.0;
        for (size_t i = 0; i < m; ++i) {
            const double moved = std::fabs(step_[i]) / std::max(1.0, std::fabs(e_.t[p_.massless[i]]));
            worst = std::isfinite(moved) ? std::max(worst, moved) : NEVER;
        }
        if (worst < CLOSE) break;
        if (k == MOST || worst == NEVER) refuse({worst == NEVER ? NON_FINITE : NEWTON_FAILED, p_.massless[0]}, now_.time);
        const double by = (k > 8 ? 0.5 : 1.0) * std::min(1.0, 0.5 / worst);
        for (size_t i = 0; i < m; ++i) e_.t[p_.massless[i]] = now_.t[p_.massless[i]] -= by * step_[i];
    }
    for (const auto& [node, own] : holds_) e_.f[own] += e_.f[node];  // what rounding leaves at a node goes where its heat is held
    for (int i : states_)
        if (!std::isfinite(e_.f[i])) refuse({NON_FINITE, i}, now_.time);
}

void FmuModel::refresh() {
    if (fresh_) return;
    if (coefficients_) renew();
    courses();
    std::copy(now_.t.begin(), now_.t.end(), e_.t.begin());
    for (size_t l = 0; l < now_.on.size(); ++l) e_.on[l] = static_cast<uint8_t>(now_.on[l]);
    if (starting_) decide();
    settle();
    fresh_ = true;
}

double FmuModel::gap(const Guard& g) const {
    if (e_.on[g.machine] != g.from) return -1.0;
    return g.sign * (e_.probe(g.of) - e_.ceff[g.level]);
}

// As the kernel's own runs begin: a thermostat is on at or below its lower threshold, a machine in its first state.
void FmuModel::decide() {
    for (int l : p_.thermostats)
        if (!(e_.ceff[p_.control.c[0][l]] < e_.ceff[p_.control.c[1][l]])) refuse({BAD_INPUT, p_.control.node[l]}, now_.time);
    settle();
    for (size_t s = 0; s < p_.samplers.size(); ++s) now_.t[p_.samplers[s].node] = e_.t[p_.samplers[s].node] = e_.factor[p_.samplers[s].factor];
    std::copy(p_.machines.begin(), p_.machines.end(), e_.on.begin() + p_.control.size());
    for (int l : p_.thermostats) e_.on[l] = e_.t[p_.control.sensor[l]] <= e_.ceff[p_.control.c[0][l]];
    settle();
    while (switch_due(true)) settle();
    std::copy(e_.on.begin(), e_.on.end(), now_.on.begin());
}

// Switches the first guard that is passed, where the evaluation stands.
bool FmuModel::switch_due(bool at_start) {
    for (const Guard& g : p_.guards) {
        if (e_.on[g.machine] != g.from) continue;
        const double left = g.delay < 0 ? gap(g) + (at_start ? 0.0 : PASSED) : at_start ? -1.0 : now_.time - now_.entered[g.machine] - e_.ceff[g.delay] + 1e-9;
        if (left < 0.0) continue;
        e_.on[g.machine] = static_cast<uint8_t>(g.to);
        now_.on[g.machine] = g.to;
        now_.entered[g.machine] = now_.time;
        return true;
    }
    return false;
}

void FmuModel::begin(double time) {
    now_.time = time;
    std::fill(now_.entered.begin(), now_.entered.end(), time);
    for (size_t k = 0; k < p_.inputs.size(); ++k)
        if (p_.inputs[k].sampled()) now_.segment[k] = p_.inputs[k].segment(time, -1);
    for (size_t s = 0; s < p_.samplers.size(); ++s) now_.sampled[s] = std::floor(time / p_.samplers[s].period) + 1.0;
    starting_ = coefficients_ = restart_ = true;
    fresh_ = false;
}

void FmuModel::end_of_start() {
    refresh();
    starting_ = false;
}

bool FmuModel::sample() {
    bool moved = false;
    for (size_t s = 0; s < p_.samplers.size(); ++s) {
        const Sampler& x = p_.samplers[s];
        if (now_.time < now_.sampled[s] * x.period - 1e-9 * x.period) continue;
        e_.follow();
        now_.t[x.node] = e_.t[x.node] = e_.factor[x.factor];
        ++now_.sampled[s];
        moved = true;
    }
    return moved;
}

bool FmuModel::update() {
    const double late = now_.time + 1e-12 * std::fabs(now_.time) + 1e-12;
    for (size_t k = 0; k < p_.inputs.size(); ++k)
        if (p_.inputs[k].sampled()) now_.segment[k] = p_.inputs[k].segment(late, static_cast<int>(now_.segment[k]));
    fresh_ = false;
    refresh();
    bool moved = sample();
    if (moved) settle();
    for (size_t k = 0; switch_due(false); ++k) {
        if (k > 2 * p_.guards.size() + 2) refuse({CHATTER, -1}, now_.time);
        settle();
        restart_ = true;
    }
    restart_ = restart_ || moved;
    return moved;
}

double FmuModel::next_event() {
    refresh();
    double next = NEVER;
    for (size_t k = 0; k < p_.inputs.size(); ++k)
        if (p_.inputs[k].sampled()) {
            const size_t i = static_cast<size_t>(now_.segment[k] + 1.0);
            if (i < p_.inputs[k].seg.size()) next = std::min(next, p_.inputs[k].seg[i].t);
        }
    for (const Guard& g : p_.guards)
        if (g.delay >= 0 && e_.on[g.machine] == g.from) next = std::min(next, now_.entered[g.machine] + e_.ceff[g.delay]);
    for (size_t s = 0; s < p_.samplers.size(); ++s) next = std::min(next, now_.sampled[s] * p_.samplers[s].period);
    return next;
}

void FmuModel::indicate(double* to) {
    refresh();
    for (size_t k = 0; k < watched_.size(); ++k) to[k] = gap(p_.guards[watched_[k]]);
}

void FmuModel::rates(double* to) {
    refresh();
    for (size_t k = 0; k < states_.size(); ++k) to[k] = e_.f[states_[k]] / coef_[p_.capacity[states_[k]]];
}

double FmuModel::get(const Variable& x) {
    if (x.kind == TIME) return now_.time;
    if (x.kind == VALUE) return now_.names[x.place];
    if (x.kind == TEMPERATURE && x.place < p_.n && p_.capacity[x.place] >= 0 && !p_.is_state(x.place)) return now_.t[x.place];
    refresh();
    switch (x.kind) {
        case TEMPERATURE: return e_.t[x.place];
        case RATE: return e_.f[x.place] / coef_[p_.capacity[x.place]];
        case MODE: return e_.on[x.place];
        case INDICATOR: return gap(p_.guards[watched_[x.place]]);
        case HEAT: {
            double heat = 0.0;
            for (int r = 0; r < p_.con.size(); ++r) {
                if (p_.con.b[r] == p_.n + x.place) heat += e_.q[r];
                if (p_.con.a[r] == p_.n + x.place && !is(p_.con.kind[r], ONE_WAY)) heat -= e_.q[r];
            }
            return heat;
        }
        default: {
            double power = 0.0;
            for (int k = image_->power_begin[x.place]; k < image_->power_begin[x.place + 1]; ++k) power += e_.power[image_->power_row[k]];
            return power;
        }
    }
}

// Heats of all rows to first order, as move_.t of unknown nodes and dcoef_ move.
void FmuModel::tangent() {
    Move& m = move_;
    const int n = p_.n, rows = p_.con.size(), loads = p_.load.size();
    m.coef.assign(p_.nc + 3, 0.0);
    for (int j = 0; j < p_.nc; ++j) m.coef[j] = dcoef_[j] * (p_.coef_input[j] < 0 ? 1.0 : e_.u[p_.coef_input[j]]);
    const auto boundaries = [&] {
        for (int k = 0; k < p_.nb; ++k) m.t[n + k] = m.coef[p_.gain[k]] + m.coef[p_.offset[k]];
    };
    boundaries();
    for (const Drive& f : p_.followers) {
        double du = 0.0;
        for (size_t k = 0; k < f.factors.size(); ++k) {
            const Factor& x = p_.factors[f.factors[k]];
            const double by = e_.bend[f.factors[k]];
            double own = 0.0;
            e_.factor_slope(f.factors[k], [&](int c, double slope) { own += slope * dcoef_[c]; });
            for (int i = 0; i < 3; ++i)
                if (x.of.node[i] >= 0 && x.of.node[i] < n) own += by * e_.ceff[x.of.c[i]] * m.t[x.of.node[i]];
            du += e_.others(f, k) * own;
        }
        for (int j : f.coefs) m.coef[j] += coef_[j] * du;
    }
    boundaries();
    m.heat.assign(rows, 0.0);
    m.power.assign(loads, 0.0);
    m.into.assign(p_.nodes(), 0.0);
    for (int r = 0; r < rows; ++r) {
        const Conductors& c = p_.con;
        double q = e_.qa[r] * m.t[c.a[r]] + e_.qb[r] * m.t[c.b[r]] + e_.phi[r] * m.coef[c.c0[r]];
        if (has_second(c.kind[r]) && m.coef[c.c1[r]] != 0.0) q += e_.con_slope({r, 1, c.c1[r]}) * m.coef[c.c1[r]];
        m.heat[r] = q;
        m.into[c.b[r]] += q;
        if (!is(c.kind[r], ONE_WAY)) m.into[c.a[r]] -= q;
    }
    for (int r = 0; r < loads; ++r) {
        const Loads& l = p_.load;
        const Controlled<double> x = e_.load(r);
        double w = x.pt * m.t[l.felt[r]] + x.ps * m.t[l.felt[loads + r]];
        for (int k = 0; k < 4; ++k) w += x.pc[k] * m.coef[l.c[k][r]];
        for (int k = 0; k < 3 && l.control[r] >= 0; ++k)
            if (!(k == 2 && p_.limited(r))) w += x.sc[k] * m.coef[p_.control.c[k][l.control[r]]];
        m.power[r] = w;
        m.into[l.node[r]] += w;
    }
}

void FmuModel::derivative(const Variable* unknown, size_t unknowns, const Variable* known, size_t knowns, const double* seed, double* to) {
    refresh();
    std::vector<double> names(now_.names.size(), 0.0);
    move_.t.assign(p_.nodes(), 0.0);
    for (size_t k = 0; k < knowns; ++k) {
        const Variable& x = known[k];
        if (x.kind == VALUE) names[x.place] += seed[k];
        else if (x.kind == TEMPERATURE && x.place < p_.n && p_.capacity[x.place] >= 0) move_.t[x.place] += seed[k];
        else throw std::invalid_argument("derivatives are with respect to states, inputs and parameters");
    }
    image_->program.slopes(value_, names.data(), slope_, dcoef_);
    tangent();
    const size_t m = p_.massless.size();
    if (m > 0) {
        factor();
        for (size_t i = 0; i < m; ++i) step_[i] = move_.into[p_.massless[i]];
        lu_.solve(step_.data());
        for (size_t i = 0; i < m; ++i) move_.t[p_.massless[i]] = -step_[i];
        tangent();
    }
    for (size_t k = 0; k < unknowns; ++k) {
        const Variable& x = unknown[k];
        if (x.kind == TEMPERATURE) {
            to[k] = move_.t[x.place];
        } else if (x.kind == RATE) {
            const int c = p_.capacity[x.place];
            to[k] = (move_.into[x.place] - e_.f[x.place] / coef_[c] * dcoef_[c]) / coef_[c];
        } else if (x.kind == HEAT) {
            to[k] = move_.into[p_.n + x.place];
        } else if (x.kind == LOAD_POWER) {
            to[k] = 0.0;
            for (int r = image_->power_begin[x.place]; r < image_->power_begin[x.place + 1]; ++r) to[k] += move_.power[image_->power_row[r]];
        } else {
            throw std::invalid_argument("derivatives are those of rates, temperatures, heats and powers");
        }
    }
}

void FmuModel::step(double to) {
    try {
        const bool driven = changed_ || restart_;  // it may be again at the next step: none reaches beyond this one
        if (driven) update();
        if (!run_ || restart_) {
            options_.on.assign(now_.on.begin(), now_.on.end());
            run_ = std::make_unique<Integrator>(p_, coef_.data(), none_, options_);
            run_->begin(now_.t.data(), now_.time, now_.entered.data(), result_);
            restart_ = false;
        } else if (changed_) {
            run_->renew();
        }
        changed_ = false;
        run_->go_on(to, driven ? to : to + AHEAD * (to - now_.time));
    } catch (const Failure& f) {
        restart_ = true;
        refuse(f, now_.time);
    }
    std::copy(run_->temperatures(), run_->temperatures() + p_.n, now_.t.begin());
    const std::vector<uint8_t>& on = run_->switches();
    now_.on.assign(on.begin(), on.end());
    now_.entered = run_->entered();
    now_.time = to;
    result_.events.clear();
    result_.mesh.clear();
    result_.steps = result_.rejected = 0;  // each step of the host may take as many as a run
    const double late = to + 1e-12 * std::fabs(to);
    for (size_t k = 0; k < p_.inputs.size(); ++k)
        if (p_.inputs[k].sampled()) now_.segment[k] = p_.inputs[k].segment(late, static_cast<int>(now_.segment[k]));
    for (size_t s = 0; s < p_.samplers.size(); ++s) now_.sampled[s] = std::floor(late / p_.samplers[s].period) + 1.0;
    fresh_ = false;
}

}  // namespace thermid
