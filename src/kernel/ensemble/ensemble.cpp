// The members of an ensemble shared out to groups, and groups to threads. Groups are the same whatever the number of threads, and no group
// looks at another, so results do not depend on it.
#include "ensemble/ensemble.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace thermid {

namespace {
const LaneCode& need_code(const std::string& simd) {
    const LaneCode* code = lane_code(simd);
    if (!code) throw std::invalid_argument("simd: this machine has no " + simd);
    return *code;
}
struct Stopped {};
}  // namespace

SummedLoads::SummedLoads(const Problem& p) : rest_(p) {
    std::vector<int> users(p.inputs.size(), 0);
    for (int k : p.coef_input)
        if (k >= 0) ++users[k];
    for (const Drive& f : p.followers)
        for (int k : {f.base, f.input})
            if (k >= 0) users[k] += 2;
    std::map<int, std::vector<int>> by_node;
    for (int r = 0; r < p.load.size(); ++r) {
        const int c = p.load.c[0][r], k = c < p.nc ? p.coef_input[c] : -1;
        if (p.load.kind[r] == SIGNAL && p.load.control[r] < 0 && k >= 0 && p.inputs[k].kind == SAMPLED_LINEAR && users[k] == 1) by_node[p.load.node[r]].push_back(r);
    }
    std::vector<char> row_goes(p.load.size(), 0), coef_goes(p.nc, 0), input_goes(p.inputs.size(), 0);
    for (const auto& [node, rows] : by_node) {
        Sum sum;
        for (int r : rows) {
            sum.terms.push_back(p.load.c[0][r]);
            for (const Input::Segment& x : p.inputs[p.coef_input[sum.terms.back()]].seg) sum.times.push_back(x.t);
            if (r != rows[0]) row_goes[r] = coef_goes[sum.terms.back()] = input_goes[p.coef_input[sum.terms.back()]] = 1;
        }
        if (rows.size() < 2) continue;
        std::sort(sum.times.begin(), sum.times.end());
        sum.times.erase(std::unique(sum.times.begin(), sum.times.end()), sum.times.end());
        for (double t : sum.times)
            for (int c : sum.terms) sum.samples.push_back(p.inputs[p.coef_input[c]].at(t));
        sums_.push_back(std::move(sum));
    }
    // Rows, coefficients and inputs that are no longer met.
    const auto drop = [](auto& list, auto unwanted) { list.erase(std::remove_if(list.begin(), list.end(), unwanted), list.end()); };
    const auto drop_at = [](auto& list, const std::vector<char>& goes) {  // of a list as long as `goes`, or a multiple of it
        size_t k = 0;
        list.erase(std::remove_if(list.begin(), list.end(), [&](const auto&) { return goes[k++ % goes.size()]; }), list.end());
    };
    const auto places = [](const std::vector<char>& goes) {
        std::vector<int> out;
        int next = 0;
        for (char g : goes) out.push_back(g ? -1 : next++);
        return out;
    };
    const std::vector<int> row = places(row_goes), input = places(input_goes);
    const auto moved_to = [&](int& k) { k = k < 0 ? k : input[k]; };
    Loads& l = rest_.load;
    for (auto* list : {&l.kind, &l.node, &l.c[0], &l.c[1], &l.c[2], &l.c[3], &l.sensor, &l.table, &l.control, &l.felt, &rest_.load_place}) drop_at(*list, row_goes);
    drop_at(rest_.inputs, input_goes);
    drop(rest_.load_entry, [&](const Entry& e) { return row_goes[e.row]; });
    for (auto* list : {&rest_.moved, &rest_.timed}) drop(*list, [&](int c) { return coef_goes[c]; });
    drop(rest_.moving, [&](int k) { return input_goes[k]; });
    for (int& k : rest_.coef_input) moved_to(k);
    for (int& k : rest_.moving) moved_to(k);
    for (Entry& e : rest_.load_entry) e.row = row[e.row];
    for (int& r : rest_.bent_loads) r = row[r];
    for (Drive& f : rest_.followers) {
        moved_to(f.base);
        moved_to(f.input);
        for (Entry& e : f.load) e.row = row[e.row];
    }
    for (Sum& sum : sums_) {
        sum.coef = sum.terms[0];
        sum.input = rest_.coef_input[sum.coef];
    }
}

Problem SummedLoads::of_member(std::vector<double>& coef) const {
    Problem out = rest_;
    for (const Sum& sum : sums_) {
        std::vector<double> watts(sum.times.size(), 0.0);
        const double* sample = sum.samples.data();
        for (double& w : watts)
            for (int c : sum.terms) w += coef[c] * *sample++;
        out.inputs[sum.input].set_samples(sum.times.data(), watts.data(), static_cast<int>(watts.size()));
        coef[sum.coef] = 1.0;
    }
    return out;
}

EnsembleSetup::EnsembleSetup(const Problem& problem, const std::string& simd, const Options& o, std::vector<double> c, std::vector<double> s,
                             long many, double from, double to, std::vector<double> when, std::vector<int> obs)
    : p(problem), network(problem), loads(problem), code(need_code(simd)), options(o), coef(std::move(c)), start(std::move(s)), members(many), t0(from), t_end(to),
      times(std::move(when)), observed(std::move(obs)) {
    stops = options.breaks;
    for (const Input& in : p.inputs) in.breaks(t0, t_end, in.kind == SAMPLED_HOLD ? 5000 : 500, stops);
    stops.erase(std::remove_if(stops.begin(), stops.end(), [&](double b) { return !(b > t0 && b < t_end); }), stops.end());
    stops.push_back(t_end);
    std::sort(stops.begin(), stops.end());
    limit = options.max_step;
    for (const Input& in : p.inputs)
        if (in.kind == SINE && in.amplitude != 0.0) limit = std::min(limit, in.period / 6.0);
}

Ensemble::Ensemble(const Problem& p, const std::string& simd, const Options& o, std::vector<double> coef, std::vector<double> start, long members,
                   double t0, double t_end, std::vector<double> times, std::vector<int> observed)
    : setup(p, simd, o, std::move(coef), std::move(start), members, t0, t_end, std::move(times), std::move(observed)), status(members, OK),
      node(members, -1), time(members, t_end), alone(members, 0), ended(members), events(members), on(members), blocks_((members + LANES - 1) / LANES) {}

// One member by the integrator, over the whole time.
void Ensemble::run_alone(Block& b, long member) {
    std::vector<double> coef(setup.p.nc), start(setup.p.n), traces(setup.times.size() * setup.observed.size() + 1);
    for (int j = 0; j < setup.p.nc; ++j) coef[j] = setup.coef[static_cast<size_t>(j) * setup.members + member];
    const Problem own = setup.loads.any() ? setup.loads.of_member(coef) : Problem();
    const Problem& p = setup.loads.any() ? own : setup.p;
    for (int i = 0; i < p.n; ++i) start[i] = setup.start[static_cast<size_t>(i) * setup.members + member];
    Options o = setup.options;
    o.energy = false;
    o.poll = [this] {
        if (stop_) throw Stopped();
    };
    Result r;
    r.traces = traces.data();
    const CoefJacobian none;
    Integrator run(p, coef.data(), none, o);
    run.run(start.data(), nullptr, setup.t0, setup.t_end, setup.times.data(), static_cast<long>(setup.times.size()), setup.observed.data(),
            static_cast<int>(setup.observed.size()), r);
    status[member] = r.status;
    node[member] = r.node;
    time[member] = r.time;
    alone[member] = 1;
    if (r.status != OK) ended[member] = r.final_t;
    events[member] = std::move(r.events);
    on[member] = std::move(r.on);
    b.steps += r.steps;
    b.rejected += r.rejected;
    b.alone.push_back(member);
    b.traces.push_back(std::move(traces));
    for (const Turnings::Point& x : r.turnings) b.turnings.push_back({member, x});
}

// In order of columns, then of members; those of a member's column are in order of time.
std::vector<Ensemble::Turning> Ensemble::turnings() const {
    std::vector<Turning> all, out;
    for (const Block& b : blocks_) all.insert(all.end(), b.turnings.begin(), b.turnings.end());
    out.resize(all.size());
    const auto ordered = [](const std::vector<Turning>& from, std::vector<Turning>& to, size_t keys, auto key) {  // by counting
        std::vector<size_t> begin(keys + 1);
        for (const Turning& x : from) ++begin[key(x) + 1];
        for (size_t k = 0; k < keys; ++k) begin[k + 1] += begin[k];
        for (const Turning& x : from) to[begin[key(x)]++] = x;
    };
    ordered(all, out, static_cast<size_t>(setup.members), [](const Turning& x) { return static_cast<size_t>(x.member); });
    ordered(out, all, setup.observed.size(), [](const Turning& x) { return static_cast<size_t>(x.point.column); });
    return all;
}

// The outputs first to last of one group.
void Ensemble::work(Block& b, long first, long last, double* out) {
    const long at = LANES * static_cast<long>(&b - blocks_.data()), end = std::min(setup.members, at + LANES);
    const size_t nobs = setup.observed.size();
    double* own = out + at * (last - first) * nobs;
    std::vector<long> fallen;
    if (setup.network.supported) {
        if (!b.group) b.group = std::make_unique<Group>(setup, at);
        b.group->advance(first, last, own, stop_);
        fallen = b.group->dropped;
    } else {
        for (long m = at; m < end; ++m) fallen.push_back(m);
    }
    for (long m : fallen) {
        if (stop_) return;
        if (!alone[m]) run_alone(b, m);
    }
    for (size_t k = 0; k < b.alone.size(); ++k)
        for (long r = first; r < last; ++r)
            for (size_t j = 0; j < nobs; ++j) own[((r - first) * nobs + j) * LANES + b.alone[k] - at] = b.traces[k][r * nobs + j];
    if (last < static_cast<long>(setup.times.size())) return;
    if (b.group) {
        b.steps += b.group->steps;
        b.rejected += b.group->rejected;
        for (Turnings::Point x : b.group->turnings()) {
            const long m = at + x.column % LANES;
            x.column /= LANES;
            if (m < end && !alone[m]) b.turnings.push_back({m, x});
        }
    }
    b.group.reset();
    b.traces.clear();
    b.alone.clear();
}

void Ensemble::advance(long rows, int threads, double* out, const std::function<void()>& poll) {
    const long last = std::min<long>(done + rows, static_cast<long>(setup.times.size()));
    std::atomic<size_t> next{0};
    std::mutex mutex;
    std::condition_variable finished;
    std::exception_ptr failure;
    size_t running = std::min<size_t>(std::max(threads, 1), blocks_.size());
    auto worker = [&] {
        try {
            for (size_t k = next++; k < blocks_.size() && !stop_; k = next++) work(blocks_[k], done, last, out);
        } catch (const Stopped&) {
        } catch (...) {
            std::lock_guard<std::mutex> lock(mutex);
            if (!failure) failure = std::current_exception();
            stop_ = true;
        }
        std::lock_guard<std::mutex> lock(mutex);
        --running;
        finished.notify_all();
    };
    std::vector<std::thread> pool;
    const size_t count = running;
    try {
        for (size_t k = 0; k < count; ++k) pool.emplace_back(worker);
    } catch (...) {  // the machine gives no more threads: those that there are do the work
        std::lock_guard<std::mutex> lock(mutex);
        running -= count - pool.size();
    }
    if (pool.empty()) throw std::runtime_error("no thread could be started");
    {
        std::unique_lock<std::mutex> lock(mutex);
        while (!finished.wait_for(lock, std::chrono::milliseconds(20), [&] { return running == 0; })) {
            lock.unlock();
            try {
                poll();
            } catch (...) {
                stop_ = true;
                lock.lock();
                if (!failure) failure = std::current_exception();
                finished.wait(lock, [&] { return running == 0; });
                break;
            }
            lock.lock();
        }
    }
    for (std::thread& t : pool) t.join();
    if (failure) std::rethrow_exception(failure);
    done = last;
    if (last < static_cast<long>(setup.times.size())) return;
    for (const Block& b : blocks_) {
        steps += b.steps;
        rejected += b.rejected;
    }
}

}  // namespace thermid
