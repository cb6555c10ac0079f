// The layout of a network for the lane code: rows, and elimination by a fixed pattern in an order of least fill.
#include <algorithm>
#include <utility>

#include "ensemble/ensemble.hpp"

#if defined(THERMID_X86_LANES)
#include <cpuid.h>
#endif

namespace thermid {

#if defined(THERMID_X86_LANES)
// Which vectors of 4 and of 8 numbers processor and operating system have: bits of CPUID's leaves 1 and 7, and of XCR0 for what a change of
// task saves (Intel 64 and IA-32 Architectures Software Developer's Manual, vol. 2A, CPUID; vol. 1, 13.3). The compilers' own test of the
// processor needs a symbol that not every runtime has (zig's).
static std::pair<bool, bool> vectors() {
    unsigned a = 0, b = 0, c = 0, d = 0, saved = 0, high = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE)) return {false, false};
    const bool fma = c & bit_FMA;
    __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    if (!fma || (saved & 0x06) != 0x06 || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2)) return {false, false};
    return {true, (saved & 0xe6) == 0xe6 && (b & bit_AVX512F) && (b & bit_AVX512DQ)};
}
#endif

std::vector<std::string> instruction_sets() {
    std::vector<std::string> out{LANES_BASELINE.name};
#if defined(THERMID_X86_LANES)
    const auto [four, eight] = vectors();
    if (four) out.push_back(LANES_AVX2.name);
    if (eight) out.push_back(LANES_AVX512.name);
#endif
    return out;
}

const LaneCode* lane_code(const std::string& name) {
    const std::vector<std::string> have = instruction_sets();
    const std::string wanted = name == "auto" ? have.back() : name;
    if (std::find(have.begin(), have.end(), wanted) == have.end()) return nullptr;
#if defined(THERMID_X86_LANES)
    for (const LaneCode* code : {&LANES_AVX512, &LANES_AVX2})
        if (wanted == code->name) return code;
#endif
    return &LANES_BASELINE;
}

LaneNetwork::LaneNetwork(const Problem& p) {
    constexpr int MOST = 400;  // nodes: larger ones are no work for a fixed elimination
    supported = p.massless.empty() && p.guards.empty() && p.followers.empty() && p.n <= MOST;
    if (!supported) return;
    for (int r = 0; r < p.con.size(); ++r) {
        const int a = p.con.a[r], b = p.con.b[r], from = a < p.n && !is(p.con.kind[r], ONE_WAY) ? a : -1, to = b < p.n ? b : -1;
        rows_.push_back({p.con.kind[r], a, b, p.con.c0[r], p.con.c1[r], p.con.table[r], p.con.place[r], from, to, {-1, -1, -1, -1}});
    }
    plan.looked = p.con.place.back();
    for (int r = 0; r < p.load.size(); ++r) {
        const int j = p.load.control[r];
        LaneLoad x{p.load.kind[r], p.load.node[r], p.load.sensor[r], {}, p.load.table[r], plan.looked, -1, p.load.sensor[r], {p.nc, p.nc, p.nc}, p.limited(r), {-1, -1}};
        if (j >= 0) {
            x.control = p.control.kind[j];
            x.sensor = p.control.sensor[j];
            for (int k = 0; k < 3; ++k) x.d[k] = p.control.c[k][j];
        }
        plan.looked += LOAD_LAWS[x.kind].tables;
        for (int k = 0; k < 4; ++k) x.c[k] = p.load.c[k][r];
        loads_.push_back(x);
    }
    for (const Table& t : p.tables) tables_.push_back(t.view());
    std::vector<int> place;
    for (const Input& in : p.inputs) {
        const bool varies = in.sampled() || (in.kind == SINE && in.amplitude != 0.0);
        place.push_back(varies ? static_cast<int>(varying.size()) : -1);
        if (varies) varying.push_back(static_cast<int>(place.size()) - 1);
    }
    auto timed = [&](const std::vector<Entry>& from, std::vector<LaneEntry>& to) {
        for (const Entry& e : from) {
            const int input = p.coef_input[e.coef] < 0 ? -1 : place[p.coef_input[e.coef]];
            if (input < 0) continue;
            supported = supported && (e.what == 0 || e.what == 4 || e.what == 5);
            to.push_back({e.row, e.what, e.coef, input});
        }
    };
    timed(p.con_entry, con_u_);
    timed(p.load_entry, load_u_);
    for (int j : p.timed)
        if (const int input = place[p.coef_input[j]]; input >= 0) {
            timed_.push_back(j);
            timed_input_.push_back(input);
        }
    plan.n = p.n;
    plan.nb = p.nb;
    plan.nc = p.nc;
    plan.nk = static_cast<int>(varying.size());
    plan.curved = false;
    for (int k : p.con.kind) plan.curved = plan.curved || !is(k, STRAIGHT);
    for (const LaneLoad& x : loads_) plan.curved = plan.curved || x.kind != SIGNAL || x.control >= 0;
    matrix(p);
    plan.rows = rows_.data();
    plan.kind_begin = p.kind_begin;
    plan.loads = loads_.data();
    plan.nloads = p.load.size();
    plan.tables = tables_.data();
    plan.timed = timed_.data();
    plan.timed_input = timed_input_.data();
    plan.ntimed = static_cast<int>(timed_.size());
    plan.gain = p.gain.data();
    plan.offset = p.offset.data();
    plan.con_u = con_u_.data();
    plan.load_u = load_u_.data();
    plan.ncon_u = static_cast<int>(con_u_.size());
    plan.nload_u = static_cast<int>(load_u_.size());
}

// Places of the Jacobian's entries, then those of the fill, and the elimination as a list of operations.
void LaneNetwork::matrix(const Problem& p) {
    const int n = p.n;
    std::vector<std::vector<int>> place(n, std::vector<int>(n, -1));
    auto entry = [&](int i, int j) {
        if (place[i][j] < 0) {
            place[i][j] = static_cast<int>(row_of_.size());
            row_of_.push_back(i);
            column_of_.push_back(j);
        }
        return place[i][j];
    };
    for (int i = 0; i < n; ++i) entry(i, i);
    for (LaneRow& r : rows_) {
        const int from = r.from, to = r.to, a = r.a < n ? r.a : -1, b = r.b < n ? r.b : -1;
        if (from >= 0) r.jac[0] = entry(from, a);
        if (from >= 0 && b >= 0) r.jac[1] = entry(from, b);
        if (to >= 0 && a >= 0) r.jac[2] = entry(to, a);
        if (to >= 0) r.jac[3] = entry(to, b);
    }
    for (LaneLoad& r : loads_)
        for (int k : {0, 1})
            if (const int at = k ? r.sensor : r.follows; at < n && (k ? r.control >= 0 : r.kind != SIGNAL)) r.jac[k] = entry(r.node, at);
    plan.entries = static_cast<int>(row_of_.size());
    for (int i = 0; i < n; ++i) {
        off_first_.push_back(static_cast<int>(off_entry_.size()));
        for (int e = n; e < plan.entries; ++e)
            if (row_of_[e] == i) {
                off_entry_.push_back(e);
                off_column_.push_back(column_of_[e]);
            }
    }
    off_first_.push_back(static_cast<int>(off_entry_.size()));
    plan.off_first = off_first_.data();
    plan.off_entry = off_entry_.data();
    plan.off_column = off_column_.data();
    std::vector<char> gone(n, 0);
    auto meets = [&](int i, int j) { return place[i][j] >= 0 || place[j][i] >= 0; };
    for (int step = 0; step < n; ++step) {
        int k = -1, least = n + 1;
        for (int i = 0; i < n; ++i) {
            if (gone[i]) continue;
            int degree = 0;
            for (int j = 0; j < n; ++j) degree += !gone[j] && j != i && meets(i, j);
            if (degree < least) {
                least = degree;
                k = i;
            }
        }
        gone[k] = 1;
        std::vector<int> below, beside;
        for (int i = 0; i < n; ++i) {
            if (gone[i]) continue;
            if (place[i][k] >= 0) below.push_back(i);
            if (place[k][i] >= 0) beside.push_back(i);
        }
        LanePivot pivot{k, static_cast<int>(lower_.size()), 0, static_cast<int>(upper_.size()), 0};
        for (int i : below) {
            LaneLower low{i, place[i][k], static_cast<int>(updates_.size()), 0};
            for (int j : beside) updates_.push_back({place[k][j], entry(i, j)});
            low.last = static_cast<int>(updates_.size());
            lower_.push_back(low);
        }
        for (int j : beside) upper_.push_back({j, place[k][j]});
        pivot.low_last = static_cast<int>(lower_.size());
        pivot.up_last = static_cast<int>(upper_.size());
        pivots_.push_back(pivot);
    }
    plan.matrix = static_cast<int>(row_of_.size());
    plan.pivots = pivots_.data();
    plan.lower = lower_.data();
    plan.updates = updates_.data();
    plan.upper = upper_.data();
}

}  // namespace thermid
