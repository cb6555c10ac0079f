// Control of the steps: how long they are, which are taken, and where they end.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "integrator/integrator.hpp"

namespace thermid {

double Integrator::first_step(double span) const {
    double a = 0.0, b = 0.0;
    for (int i = 0; i < n_; ++i)
        if (setup_.cap[i] > -1e-3 * span * slaved_.own_rate(i)) {
            a = std::max(a, std::fabs(step_.d0[i]));
            b = std::max(b, std::fabs(step_.dd0[i]));
        }
    const double h = b > 0.0 ? 0.1 * a / b : 0.01 * span;
    return std::min(std::max(h, 1e-6 * span), 0.05 * span);
}

// Heavy nodes tied closely together, which start apart: the shortest time in which they meet, for no polynomial follows them over a longer
// step. A light node that settles at once is not among them; its outputs follow the others'.
double Integrator::settling() {
    double time = std::numeric_limits<double>::infinity();
    slaved_.make(slaved_.fast, 1e-3);
    for (int i : slaved_.fast.tied) {
        const double own = std::fabs(step_.J0[p_.pattern.diag[i]]);
        if (std::fabs(step_.F[i]) > 1e-6 * own) time = std::min(time, setup_.cap[i] / own);
    }
    return std::max(time, 1e-14 * std::fabs(state_.t));
}

// Whether a step is given up for its error, in parts of what is allowed; then `next` is the length to try.
bool Integrator::too_long(double err, double& next) {
    if (err <= step_.slack) return false;
    next = step_.h * (std::isfinite(err) ? std::max(0.2, 0.9 * std::pow(err, -0.25)) : 0.2);
    pending_ = -1;
    if (state_.t + next == state_.t || next < 1e-14 * std::fabs(state_.t)) underflow(STEP_UNDERFLOW);
    return true;
}

// One trial of a step of length step_.h to step_.end. True if accepted; `next` is the step to try next.
bool Integrator::attempt(OutputList& out, double& next) {
    const bool watch = !p_.guards.empty();
    stages_.project();
    stages_.start(first_);
    if (outputs_.turnings.on()) outputs_.turnings_start();
    first_ = false;
    inside_ = watch || step_.end > asked_ || outputs_.turnings.on() || (out.next < out.n && out.t[out.next] <= step_.end);
    const double left = errors_.input_error();
    if (left > step_.slack * o_.input_atol) {
        hold_ = step_.h * std::max(0.2, 0.8 * std::pow(o_.input_atol / left, 0.4));  // the caller's next stands
        return false;
    }
    if (np_ > 0) {
        stages_.start_sensitivity();
        if (inside_) outputs_.dense_start();
    }
    if (!stages_.solve()) {
        next = 0.25 * step_.h;
        if (pending_ >= 0) pending_ = -1;
        if (state_.t + next == state_.t || next < 1e-14 * (std::fabs(state_.t) + step_.h)) underflow(NEWTON_FAILED);
        return false;
    }
    double err = errors_.error();
    if (too_long(err, next)) return false;
    if (p_.knees() && !errors_.clear_of_knees(next)) {
        pending_ = -1;
        return false;
    }
    if (inside_ && state_.t + 0.1 * step_.h > state_.t && errors_.unsettled() > std::max(1e-6, 10.0 * errors_.tolerance())) {
        next = 0.1 * step_.h;
        pending_ = -1;
        return false;
    }
    if (step_.leftover) errors_.improve();
    if (errors_.closes()) errors_.close_balance(step_.h);
    check_state();
    outputs_.dense(inside_);
    if (inside_) {
        // What the projection of inputs leaves shows here too: no finer than these are followed.
        err = std::max(err, outputs_.apart() / (step_.leftover ? std::max(errors_.tolerance(), o_.input_atol) : errors_.tolerance()));
        if (too_long(err, next)) return false;
    }
    if (watch) {
        double s = step_.h;
        int l = pending_;
        if (pending_ < 0 && find_event(s, l)) {
            pending_ = l;
            refined_ = 0;
            resume_ = step_.h;
            s = std::max(s, 1e-9 + 1e-14 * std::fabs(state_.t));
            shortened_ = s < step_.h && step_.factors.kept && !step_.leftover && setup_.holds.empty();
            if (shortened_) outputs_.shorten(s);
        }
        if (pending_ >= 0 && !shortened_) {
            if (s == step_.h) {  // the step ends near the instant: improve it
                const double g = gap_at(pending_, step_.h), rate = gap_rate(p_.guards[pending_]);
                if (rate > 0.0) s = step_.h - g / rate;
            }
            if (std::fabs(s - step_.h) > 1e-10 * std::max(1.0, 1e-3 * std::fabs(state_.t)) && ++refined_ < 12 && s > 0.0 && s < 2.0 * step_.h) {
                next = s;
                return false;
            }
        }
    }
    const double e = std::max(err, 1e-6);
    // What a jump of a projected input leaves is a matter of chance: answered in full, steps would only swing, and the longest would set the
    // error of all. Answered weakly, half of them stay below an eighth of what is allowed.
    // Where a caller's own times cut steps, halves that err little would stay halves: they say at once how long a step may be. On a ladder of steps
    // the answer must reach the next rung, too.
    const double wish = step_.leftover && err > 1e-3 ? std::pow(e, -0.05)
                        : in_parts_ && clipped_      ? std::pow(e, -0.25)
                        : step_.factors.kept         ? std::pow(e, -0.2)
                                                     : std::pow(e, -0.175) * std::pow(old_error_, 0.1);
    const double factor = std::min(5.0, std::max(0.2, 0.9 * wish));
    old_error_ = std::max(err, 1e-3);
    next = step_.h * factor;
    if (step_.leftover)
        hold_ = left > 0.0 ? step_.h * std::min(2.0, 0.8 * std::pow(o_.input_atol / left, 0.4)) : 2.0 * step_.h;
    else if (hold_ < std::numeric_limits<double>::infinity())
        hold_ *= 1.02;
    return true;
}

void Integrator::advance(double t_end, OutputList& out) {
    std::vector<double> stops = o_.breaks;
    for (const Input& in : p_.inputs) in.breaks(state_.t, t_end, in.kind == SAMPLED_HOLD ? 5000 : 500, stops);
    for (const Sampler& s : p_.samplers)
        for (double k = std::floor(state_.t / s.period) + 1.0; k * s.period < t_end; ++k) stops.push_back(k * s.period);
    stops.erase(std::remove_if(stops.begin(), stops.end(), [&](double b) { return !(b > state_.t && b < t_end); }), stops.end());
    const bool given = !o_.mesh.empty();
    if (given) {
        stops.clear();
        std::copy_if(o_.mesh.begin(), o_.mesh.end(), std::back_inserter(stops), [&](double b) { return b > state_.t && b < t_end; });
        step_.slack = 15.0;
    }
    for (const Edge& e : p_.edges)
        if (e.time > state_.t && e.time < t_end) stops.push_back(e.time);
    stops.push_back(t_end);
    std::sort(stops.begin(), stops.end());
    size_t stop = 0;
    const long rest = std::clamp(static_cast<long>(1e8 / std::pow(n_, 3) / (1.0 + np_)), 1L, 1000L);  // steps between two looks at the interrupt key
    double limit = o_.max_step;
    for (const Input& in : p_.inputs)
        if (in.kind == SINE && in.amplitude != 0.0) limit = std::min(limit, in.period / 6.0);
    double next = wish_;
    if (next == 0.0) {  // a look at the start for the first step length
        step_.h = t_end - state_.t;
        step_.end = t_end;
        stages_.project();
        stages_.start(true);
        next = given ? t_end - state_.t : std::min(first_step(t_end - state_.t), settling());
    }
    double wish = next;
    while (state_.t < t_end) {
        if (r_->steps + r_->rejected >= o_.max_steps) throw Failure{MAX_STEPS, worst(step_.err)};
        if ((r_->steps + r_->rejected) % rest == rest - 1 && o_.poll) o_.poll();
        while (stops[stop] <= state_.t) ++stop;
        const double room = stops[stop] - state_.t;
        step_.h = next;
        clipped_ = false;
        double knot = -1.0;
        if (pending_ < 0) {
            wish = step_.h = step_.factors.kept && !given && !step_.leftover ? step_.factors.rung(std::min(next, limit)) : std::min(next, limit);
            if (hold_ < step_.h) {
                // Up to the next knot nothing is left over; where the inputs allow about one sample, end the step there.
                knot = std::numeric_limits<double>::infinity();
                for (int k = 0; k < nk_; ++k)
                    if (p_.inputs[k].sampled()) knot = std::min(knot, p_.inputs[k].next_knot(state_.t, step_.hint[k]));
                step_.h = hold_ < 2.0 * (knot - state_.t) ? std::min(step_.h, knot - state_.t) : hold_;
                clipped_ = step_.h < wish;
            }
        }
        step_.end = step_.h == knot - state_.t ? knot : state_.t + step_.h;
        if (pending_ < 0) {
            // Where the step ends at a knot just before a stop it stays there: what is left over of a jump between them would be refused for ever.
            if (step_.h > room || (step_.h > 0.99 * room && step_.end != knot)) {
                clipped_ = clipped_ || step_.h > room;
                step_.h = room;
                step_.end = stops[stop];
            } else if (step_.h > 0.5 * room && step_.end != knot) {
                step_.h = 0.5 * room;  // no tiny step before a break
                step_.end = state_.t + step_.h;
                clipped_ = true;
            }
        }
        if (!attempt(out, next)) {
            ++r_->rejected;
            continue;
        }
        if (clipped_) next = std::max(next, wish);
        beyond_ = step_.end > asked_;
        if (beyond_) break;
        take(out, next);
        if (given) {  // the next step of the mesh, whatever this one suggests
            next = t_end - state_.t;
            hold_ = std::numeric_limits<double>::infinity();
        }
    }
    if (in_parts_) wish_ = next;
}

// The step that was made becomes the past; `next` is the step to try next.
void Integrator::take(OutputList& out, double& next) {
    ++r_->steps;
    state_.drift.swap(step_.drift_next);
    if (outputs_.turnings.on()) outputs_.turnings_end(out);
    outputs_.emit(out, *r_);
    if (o_.energy) {
        for (size_t r = 0; r < state_.E_con.size(); ++r) state_.E_con[r] += step_.h * step_.acc_con[r];
        for (size_t r = 0; r < state_.E_load.size(); ++r) state_.E_load[r] += step_.h * step_.acc_load[r];
    }
    if (pending_ >= 0) {
        same_time_ = step_.h > 1e-8 + 1e-13 * std::fabs(state_.t) ? 0 : same_time_ + 1;
        apply_events();
        pending_ = -1;
        next = std::max(next, shortened_ ? resume_ : 0.25 * resume_);
        shortened_ = false;
    } else {
        state_.T.swap(step_.T1);
        state_.S.swap(step_.S1);
        state_.t = step_.end;
    }
    if (np_ > 0) pass_edges();
    if (!p_.samplers.empty()) sample();
    seen();
    r_->mesh.push_back(state_.t);
}

}  // namespace thermid
