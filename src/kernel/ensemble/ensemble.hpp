// Many runs of one network at other coefficients: groups of eight members step together in the lane code, with one step sequence and
// one projection of the inputs for a group; members that the lane code cannot take are run one by one by the integrator.
#pragma once
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ensemble/ensemble_lanes.hpp"
#include "integrator/integrator.hpp"

namespace thermid {

// The names of the instruction sets that this machine has, the widest last.
std::vector<std::string> instruction_sets();
const LaneCode* lane_code(const std::string& name);  // "auto" gives the widest; null when the machine lacks it

// A problem laid out for the lane code.
class LaneNetwork {
  public:
    explicit LaneNetwork(const Problem& p);
    bool supported = true;  // thermostats, massless nodes and inputs in an exponent are left to the integrator
    LanePlan plan{};
    std::vector<int> varying;  // the inputs that change in time; the lane code knows no others

  private:
    LaneNetwork(const LaneNetwork&) = delete;
    void matrix(const Problem& p);
    std::vector<LaneRow> rows_;
    std::vector<LaneLoad> loads_;
    std::vector<LaneTable> tables_;
    std::vector<LaneEntry> con_u_, load_u_;
    std::vector<int> timed_, timed_input_, row_of_, column_of_, off_first_, off_entry_, off_column_;
    std::vector<LanePivot> pivots_;
    std::vector<LaneLower> lower_;
    std::vector<LaneUpdate> updates_;
    std::vector<LaneUpper> upper_;
};

// Powers that are straight lines between samples, summed for each node: for one member that sum is such a line too, so the integrator
// meets one input in place of hundreds.
class SummedLoads {
  public:
    explicit SummedLoads(const Problem& p);
    bool any() const { return !sums_.empty(); }
    Problem of_member(std::vector<double>& coef) const;  // the problem with the sums of a member; sets the coefficients of these to one

  private:
    struct Sum {
        int input, coef;                     // of the load that carries it
        std::vector<int> terms;              // coefficients
        std::vector<double> times, samples;  // (times), (times, terms)
    };
    Problem rest_;  // with empty sums
    std::vector<Sum> sums_;
};

// What all groups of an ensemble share.
struct EnsembleSetup {
    const Problem& p;
    const LaneNetwork network;
    const SummedLoads loads;
    const LaneCode& code;
    const Options options;
    const std::vector<double> coef, start;  // (coefficients, members), (nodes, members)
    const long members;
    const double t0, t_end;
    const std::vector<double> times;
    const std::vector<int> observed;
    std::vector<double> stops;  // where steps end: jumps of inputs, and the end
    double limit;               // step limit by sine inputs
    EnsembleSetup(const Problem& p, const std::string& simd, const Options& o, std::vector<double> coef, std::vector<double> start, long members,
                  double t0, double t_end, std::vector<double> times, std::vector<int> observed);
};

// Eight members, from `first`; where fewer are left, the last one fills the lanes.
class Group {
  public:
    Group(const EnsembleSetup& s, long first);
    // Steps until the outputs up to `last` are written to out (outputs from `from`, observed, LANES).
    void advance(long from, long last, double* out, const std::atomic<bool>& stop);
    const std::vector<Turnings::Point>& turnings();  // once the end is reached; columns: (observed, LANES)
    std::vector<long> dropped;  // members that the lane code gave up
    long steps = 0, rejected = 0;

  private:
    const EnsembleSetup& s_;
    const long first_;
    const int count_;
    std::vector<double> memory_;
    std::vector<char> quarter_, active_;
    std::vector<double> u_, slopes_, bends_, weights_, worst_;
    std::vector<double> outer_;  // temperatures of boundaries at the start of the step (boundaries, LANES)
    std::vector<StepInput> in_;
    std::vector<int> hint_;
    std::vector<Cursor> cursor_;
    LaneGroup g_{};
    unsigned alive_ = (1u << LANES) - 1;
    double low_[LANES], high_[LANES];
    double t_, end_, origin_, next_ = 0.0, wish_ = 0.0, hold_, old_error_ = 1.0;
    long out_next_ = 0;
    size_t stop_ = 0;
    int fails_ = 0;
    bool leftover_ = false, clipped_ = false, begun_ = false;

    void layout();
    void fill(int lane, long member);
    void initial();
    void inputs_at(double s);
    void project();
    double first_step() const;
    void choose(double& next);
    bool attempt(double& next);
    bool clear_of_knees(const double* tolerance, double& next) const;
    void dense();
    bool too_fast(double& next);
    bool failed(unsigned lanes, double& next, double factor);
    double input_error();
    const Input& input(int k) const { return s_.p.inputs[s_.network.varying[k]]; }
    unsigned check_state();
    void drop(unsigned lanes);
    void emit(long from, long last, double* out);
    void turn();
    double strongest(int k) const;
    void weigh(double time);
    Turnings turnings_;
    std::vector<double> seen_, seen_times_;
};

class Ensemble {
  public:
    Ensemble(const Problem& p, const std::string& simd, const Options& o, std::vector<double> coef, std::vector<double> start, long members, double t0,
             double t_end, std::vector<double> times, std::vector<int> observed);
    // The next `rows` outputs of all members: out (groups, rows, observed, LANES). poll is called now and then by the calling thread and may throw.
    void advance(long rows, int threads, double* out, const std::function<void()>& poll);
    const EnsembleSetup setup;
    std::vector<int> status, node;  // of each member
    std::vector<double> time;
    std::vector<char> alone;        // members that the integrator ran
    std::vector<std::vector<double>> ended;  // of members that did not reach the end: temperatures where they stopped
    std::vector<std::vector<Event>> events;  // of members that the integrator ran, in order of time
    std::vector<std::vector<int>> on;        // their switches at the end
    // Turning points of the observed nodes, member by member, once all outputs are out.
    struct Turning { long member; Turnings::Point point; };
    std::vector<Turning> turnings() const;
    long done = 0, steps = 0, rejected = 0;

  private:
    struct Block {
        std::unique_ptr<Group> group;
        std::vector<long> alone;
        std::vector<std::vector<double>> traces;  // of those, all outputs
        std::vector<Turning> turnings;
        long steps = 0, rejected = 0;
    };
    std::vector<Block> blocks_;
    std::atomic<bool> stop_{false};
    void work(Block& b, long first, long last, double* out);
    void run_alone(Block& b, long member);
};

}  // namespace thermid
