// Control of the steps: how long they are, which are taken, and where they end.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "integrator/integrator.hpp"

namespace thermid {

double Integrator::first_step(double span) const {
    double a = 0.0, b = 0.0;
    for (int i = 0; i < n_; ++i)
        if (cap_[i] > -1e-3 * span * own_rate(i)) {
            a = std::max(a, std::fabs(d0_[i]));
            b = std::max(b, std::fabs(dd0_[i]));
        }
    const double h = b > 0.0 ? 0.1 * a / b : 0.01 * span;
    return std::min(std::max(h, 1e-6 * span), 0.05 * span);
}

// Heavy nodes tied closely together, which start apart: the shortest time in which they meet, for no polynomial follows them over a longer
// step. A light node that settles at once is not among them; its outputs follow the others'.
double Integrator::settling() {
    double time = std::numeric_limits<double>::infinity();
    make_slaved(fast_, 1e-3);
    for (int i : fast_.tied) {
        const double own = std::fabs(J0_[p_.pattern.diag[i]]);
        if (std::fabs(F_[i]) > 1e-6 * own) time = std::min(time, cap_[i] / own);
    }
    return std::max(time, 1e-14 * std::fabs(t_));
}

// One trial of a step of length h_ to end_. True if accepted; `next` is the step to try next.
bool Integrator::attempt(Outputs& out, double& next) {
    const bool watch = !p_.guards.empty();
    project();
    start(first_);
    if (turnings_.on()) turnings_start();
    first_ = false;
    inside_ = watch || turnings_.on() || (out.next < out.n && out.t[out.next] <= end_);
    const double left = input_error();
    if (left > slack_ * o_.input_atol) {
        hold_ = h_ * std::max(0.2, 0.8 * std::pow(o_.input_atol / left, 0.4));  // the caller's next stands
        return false;
    }
    if (np_ > 0) {
        start_sensitivity();
        if (inside_) dense_start();
    }
    if (!stages()) {
        next = 0.25 * h_;
        if (pending_ >= 0) pending_ = -1;
        if (t_ + next == t_ || next < 1e-14 * (std::fabs(t_) + h_)) underflow(NEWTON_FAILED);
        return false;
    }
    const double err = error();
    if (!(err <= slack_)) {
        next = h_ * (std::isfinite(err) ? std::max(0.2, 0.9 * std::pow(err, -0.25)) : 0.2);
        pending_ = -1;
        if (t_ + next == t_ || next < 1e-14 * std::fabs(t_)) underflow(STEP_UNDERFLOW);
        return false;
    }
    if (p_.knees() && !clear_of_knees(next)) {
        pending_ = -1;
        return false;
    }
    if (inside_ && t_ + 0.1 * h_ > t_ && unsettled() > std::max(1e-6, 10.0 * tolerance())) {
        next = 0.1 * h_;
        pending_ = -1;
        return false;
    }
    if (leftover_) improve();
    if (closes_) close_balance();
    check_state();
    dense(inside_);
    if (watch) {
        double s = h_;
        int l = pending_;
        if (pending_ < 0 && find_event(s, l)) {
            pending_ = l;
            refined_ = 0;
            resume_ = h_;
            s = std::max(s, 1e-9 + 1e-14 * std::fabs(t_));
        }
        if (pending_ >= 0) {
            if (s == h_) {  // the step ends near the instant: improve it
                const double g = gap_at(pending_, h_), rate = gap_rate(p_.guards[pending_]);
                if (rate > 0.0) s = h_ - g / rate;
            }
            if (std::fabs(s - h_) > 1e-10 * std::max(1.0, 1e-3 * std::fabs(t_)) && ++refined_ < 12 && s > 0.0 && s < 2.0 * h_) {
                next = s;
                return false;
            }
        }
    }
    const double e = std::max(err, 1e-6);
    // What a jump of a projected input leaves is a matter of chance: answered in full, steps would only swing, and the longest would set the
    // error of all. Answered weakly, half of them stay below an eighth of what is allowed.
    const double wish = leftover_ && err > 1e-3 ? std::pow(e, -0.05) : std::pow(e, -0.175) * std::pow(old_error_, 0.1);
    const double factor = std::min(5.0, std::max(0.2, 0.9 * wish));
    old_error_ = std::max(err, 1e-3);
    next = h_ * factor;
    if (leftover_)
        hold_ = left > 0.0 ? h_ * std::min(2.0, 0.8 * std::pow(o_.input_atol / left, 0.4)) : 2.0 * h_;
    else if (hold_ < std::numeric_limits<double>::infinity())
        hold_ *= 1.02;
    return true;
}

void Integrator::advance(double t_end, Outputs& out) {
    std::vector<double> stops = o_.breaks;
    for (const Input& in : p_.inputs) in.breaks(t_, t_end, in.kind == SAMPLED_HOLD ? 5000 : 500, stops);
    for (const Sampler& s : p_.samplers)
        for (double k = std::floor(t_ / s.period) + 1.0; k * s.period < t_end; ++k) stops.push_back(k * s.period);
    stops.erase(std::remove_if(stops.begin(), stops.end(), [&](double b) { return !(b > t_ && b < t_end); }), stops.end());
    const bool given = !o_.mesh.empty();
    if (given) {
        stops.clear();
        std::copy_if(o_.mesh.begin(), o_.mesh.end(), std::back_inserter(stops), [&](double b) { return b > t_ && b < t_end; });
        slack_ = 15.0;
    }
    stops.push_back(t_end);
    std::sort(stops.begin(), stops.end());
    size_t stop = 0;
    const long rest = std::clamp(static_cast<long>(1e8 / std::pow(n_, 3) / (1.0 + np_)), 1L, 1000L);  // steps between two looks at the interrupt key
    double limit = o_.max_step;
    for (const Input& in : p_.inputs)
        if (in.kind == SINE && in.amplitude != 0.0) limit = std::min(limit, in.period / 6.0);
    double next = wish_;
    if (next == 0.0) {  // a look at the start for the first step length
        h_ = t_end - t_;
        end_ = t_end;
        project();
        start(true);
        next = given ? t_end - t_ : std::min(first_step(t_end - t_), settling());
    }
    double wish = next;
    while (t_ < t_end) {
        if (r_->steps + r_->rejected >= o_.max_steps) throw Failure{MAX_STEPS, worst(err_)};
        if ((r_->steps + r_->rejected) % rest == rest - 1 && o_.poll) o_.poll();
        while (stops[stop] <= t_) ++stop;
        const double room = stops[stop] - t_;
        h_ = next;
        clipped_ = false;
        double knot = -1.0;
        if (pending_ < 0) {
            wish = h_ = std::min(next, limit);
            if (hold_ < h_) {
                // Up to the next knot nothing is left over; where the inputs allow about one sample, end the step there.
                knot = std::numeric_limits<double>::infinity();
                for (int k = 0; k < nk_; ++k)
                    if (p_.inputs[k].sampled()) knot = std::min(knot, p_.inputs[k].next_knot(t_, hint_[k]));
                h_ = hold_ < 2.0 * (knot - t_) ? std::min(h_, knot - t_) : hold_;
                clipped_ = h_ < wish;
            }
        }
        end_ = h_ == knot - t_ ? knot : t_ + h_;
        if (pending_ < 0) {
            if (h_ > 0.99 * room) {
                clipped_ = clipped_ || h_ > room;
                h_ = room;
                end_ = stops[stop];
            } else if (h_ > 0.5 * room && end_ != knot) {
                h_ = 0.5 * room;  // no tiny step before a break
                end_ = t_ + h_;
                clipped_ = true;
            }
        }
        if (!attempt(out, next)) {
            ++r_->rejected;
            continue;
        }
        ++r_->steps;
        drift_.swap(drift_next_);
        if (clipped_) next = std::max(next, wish);
        if (turnings_.on()) turnings_end(out);
        emit(out);
        if (o_.energy) {
            for (size_t r = 0; r < E_con_.size(); ++r) E_con_[r] += h_ * acc_con_[r];
            for (size_t r = 0; r < E_load_.size(); ++r) E_load_[r] += h_ * acc_load_[r];
        }
        if (pending_ >= 0) {
            same_time_ = h_ > 1e-8 + 1e-13 * std::fabs(t_) ? 0 : same_time_ + 1;
            apply_events();
            pending_ = -1;
            next = std::max(next, 0.25 * resume_);
        } else {
            T_.swap(T1_);
            S_.swap(S1_);
            t_ = end_;
        }
        if (!p_.samplers.empty()) sample();
        seen();
        r_->mesh.push_back(t_);
        if (given) {  // the next step of the mesh, whatever this one suggests
            next = t_end - t_;
            hold_ = std::numeric_limits<double>::infinity();
        }
    }
    if (in_parts_) wish_ = next;
}

}  // namespace thermid
